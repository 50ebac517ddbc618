#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "peers/method.h"

/// A hierarchy of bounding spheres over the pixels of a depth image, for methods that know the
/// distance of a point to a link: a group of points is no nearer than its sphere's centre, less the
/// sphere's radius.
namespace ist::benchmark {

/// A group of points: all are within `radius` of `center`.
struct GroupSphere {
  Eigen::Vector3f center;  ///< [m] in the sensor frame
  float radius;            ///< [m] < 0: no points
};

/// Squares of 4 x 4 pixels, and above them squares of squares. Points stay in the message.
class ImagePyramid {
 public:
  static constexpr std::size_t kSide = 4;  // pixels of the smallest squares

  struct Level {
    std::size_t width = 0, height = 0;  // squares
    std::vector<GroupSphere> spheres;   // by row
    std::vector<Eigen::AlignedBox3f> boxes;

    const GroupSphere& at(std::size_t u, std::size_t v) const { return spheres[v * width + u]; }
  };

  /// One pass over the bytes, and one over the squares of each level. Keeps its memory.
  /// @param frame  stays unchanged until the next call
  void build(const Frame& frame);

  /// From the smallest squares to the whole image.
  const std::vector<Level>& levels() const { return levels_; }
  std::size_t width() const { return frame_->width; }
  std::size_t height() const { return frame_->height; }
  /// A pixel's point [m] in the sensor frame; NaN where nothing was measured.
  Eigen::Vector3f point(std::size_t pixel) const { return frame_->point(pixel); }

 private:
  const Frame* frame_ = nullptr;
  std::vector<Level> levels_;
};

/// The nearest point, as a search goes on.
struct NearestPixel {
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::size_t pixel = kNone;
  float distance = std::numeric_limits<float>::infinity();  ///< [m]
};

/// Best-first search for the pixel whose point is nearest to a link, by a function that changes no
/// faster than points move.
///
/// Distance: float(p_L, bound) returns the distance of a point in the link's frame where it is
/// below `bound`, else anything that is not.
class PyramidSearch {
 public:
  /// @param X_LS   sensor frame -> link frame
  /// @param start  a pixel that is likely to be near: it is measured first
  template <typename Distance>
  NearestPixel run(const ImagePyramid& pyramid, const Eigen::Isometry3f& X_LS, std::size_t start,
                   Distance&& distance) {
    nearest_ = NearestPixel();
    if (start < pyramid.width() * pyramid.height()) {
      measure(X_LS * pyramid.point(start), start, std::numeric_limits<float>::infinity(),
              no_witness(), distance);
    }
    queue_.clear();
    const auto top = static_cast<std::uint32_t>(pyramid.levels().size() - 1);
    push({-std::numeric_limits<float>::infinity(), top, 0, 0}, X_LS, pyramid, nullptr, distance);
    while (!queue_.empty() && queue_.front().bound < nearest_.distance) {
      std::pop_heap(queue_.begin(), queue_.end());
      const Entry entry = queue_.back();
      queue_.pop_back();
      if (entry.level == 0) {
        measure_points(entry, pyramid, X_LS, distance);
      } else {
        expand(entry, pyramid, X_LS, distance);
      }
    }
    return nearest_;
  }

 private:
  static Eigen::Vector3f no_witness() {
    return Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  }

  // A sphere that was measured: `bound` is the centre's distance less the radius.
  struct Entry {
    float bound;  // [m]
    std::uint32_t level, u, v;
    Eigen::Vector3f center_L = Eigen::Vector3f::Zero();  // [m]
    float distance = 0.0F;                               // [m] of the centre
    Eigen::Vector3f witness_L = no_witness();            // [m] the surface point nearest to it

    bool operator<(const Entry& other) const { return bound > other.bound; }
  };

  template <typename Distance>
  void measure(const Eigen::Vector3f& p_L, std::size_t pixel, float at_most,
               Eigen::Vector3f witness_L, Distance& distance) {
    if (!(p_L.x() == p_L.x())) return;  // NaN
    const float d = distance(p_L, std::min(nearest_.distance, at_most), &witness_L);
    if (d < nearest_.distance) nearest_ = {pixel, d};
  }

  // Measures a sphere's centre and queues it, unless no point of it is near enough. The distance of
  // the parent's centre bounds it from both sides.
  template <typename Distance>
  void push(Entry entry, const Eigen::Isometry3f& X_LS, const ImagePyramid& pyramid,
            const Entry* parent, Distance& distance) {
    const GroupSphere& sphere = pyramid.levels()[entry.level].at(entry.u, entry.v);
    if (sphere.radius < 0.0F) return;
    entry.center_L = X_LS * sphere.center;
    float bound = nearest_.distance + sphere.radius;  // farther centres need no distance
    if (parent != nullptr) {
      const float moved = (entry.center_L - parent->center_L).norm();
      if (parent->distance - moved >= bound) return;
      // The centre is within parent->distance + moved; a little more, for rounding.
      bound = std::min(bound, 1.0001F * (parent->distance + moved) + 1e-5F);
      entry.witness_L = parent->witness_L;
    }
    entry.distance = distance(entry.center_L, bound, &entry.witness_L);
    entry.bound = entry.distance - sphere.radius;
    if (entry.bound >= nearest_.distance) return;
    queue_.push_back(entry);
    std::push_heap(queue_.begin(), queue_.end());
  }

  template <typename Distance>
  void expand(const Entry& entry, const ImagePyramid& pyramid, const Eigen::Isometry3f& X_LS,
              Distance& distance) {
    const ImagePyramid::Level& below = pyramid.levels()[entry.level - 1];
    for (std::uint32_t v = 2 * entry.v; v < std::min<std::size_t>(2 * entry.v + 2, below.height);
         ++v) {
      for (std::uint32_t u = 2 * entry.u; u < std::min<std::size_t>(2 * entry.u + 2, below.width);
           ++u) {
        push({0.0F, entry.level - 1, u, v}, X_LS, pyramid, &entry, distance);
      }
    }
  }

  template <typename Distance>
  void measure_points(const Entry& entry, const ImagePyramid& pyramid,
                      const Eigen::Isometry3f& X_LS, Distance& distance) {
    constexpr std::size_t kSide = ImagePyramid::kSide;
    for (std::size_t v = kSide * entry.v; v < std::min(kSide * (entry.v + 1), pyramid.height());
         ++v) {
      for (std::size_t u = kSide * entry.u; u < std::min(kSide * (entry.u + 1), pyramid.width());
           ++u) {
        const std::size_t pixel = v * pyramid.width() + u;
        const Eigen::Vector3f p_L = X_LS * pyramid.point(pixel);
        const float moved = (p_L - entry.center_L).norm();
        if (entry.distance - moved < nearest_.distance) {
          measure(p_L, pixel, 1.0001F * (entry.distance + moved) + 1e-5F, entry.witness_L,
                  distance);
        }
      }
    }
  }

  std::vector<Entry> queue_;
  NearestPixel nearest_;
};

/// A method that searches the image for each link's nearest pixel.
class OfGroups : public Method {
 public:
  explicit OfGroups(const Robot& robot) : last_(robot.meshes.size(), NearestPixel::kNone) {}

  void ingest(const Frame& frame) override {
    pyramid_.build(frame);
    X_FS_ = frame.X_FS;
  }

 protected:
  /// @param distance  as PyramidSearch takes it
  /// @param surface   (p_L, distance): the link's point nearest to p_L
  template <typename Distance, typename Surface>
  Answer find(std::size_t link, const Eigen::Isometry3d& X_FL, Distance&& distance,
              const Surface& surface) {
    const Eigen::Isometry3f X_LS = (X_FL.inverse() * X_FS_).cast<float>();
    const NearestPixel nearest = search_.run(pyramid_, X_LS, last_[link], distance);
    last_[link] = nearest.pixel;
    const Eigen::Vector3f p_S = pyramid_.point(nearest.pixel);
    const Eigen::Vector3f surface_L = surface(X_LS * p_S, nearest.distance);
    return {static_cast<double>(nearest.distance), X_FL * surface_L.cast<double>(),
            X_FS_ * p_S.cast<double>()};
  }

 private:
  ImagePyramid pyramid_;
  PyramidSearch search_;
  Eigen::Isometry3d X_FS_;
  std::vector<std::size_t> last_;  // nearest pixel by link
};

}  // namespace ist::benchmark
