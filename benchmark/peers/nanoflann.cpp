#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nanoflann.hpp>
#include <optional>
#include <vector>

#include "peers/flat.h"

// A k-d tree over all points, or over the centres of occupied voxels, queried for the point nearest
// to each sphere.
namespace ist::benchmark {
namespace {

struct Cloud {
  Points points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return axis == 0 ? points.x[i] : axis == 1 ? points.y[i] : points.z[i];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3>;

class Nanoflann : public BySpheres {
 public:
  // @param voxel  [m] edge of the voxels; 0: all points
  Nanoflann(const SphereSet& set, float voxel) : BySpheres(set), voxel_(voxel) {
    name = voxel > 0.0F ? "nanoflann on voxels of 1 cm" : "nanoflann";
    kind = Kind::kSpheres;
    const double off = 0.5 * std::sqrt(3.0) * static_cast<double>(voxel);
    largest_error = set.gap + off + kRounding;
    least_error = -set.gap - off;
  }

  void ingest(const Frame& frame) override {
    tree_.reset();
    cloud_.points.read(frame);
    if (voxel_ > 0.0F) keep_voxels();
    tree_.emplace(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    tree_->buildIndex();
  }

 protected:
  bool nearest(const Eigen::Vector3d& center, double max_distance, Nearest* found) override {
    const Eigen::Vector3f c = center.cast<float>();
    std::size_t index = 0;
    float distance_sq = 0.0F;
    nanoflann::KNNResultSet<float> result(1);
    result.init(&index, &distance_sq);
    if (max_distance < 1e15) distance_sq = static_cast<float>(max_distance * max_distance);
    tree_->findNeighbors(result, c.data(), nanoflann::SearchParams());
    if (result.size() == 0) return false;
    found->p_FCo = cloud_.points.at(index).cast<double>();
    found->distance = (found->p_FCo - center).norm();
    return true;
  }

 private:
  // The points become the centres of occupied voxels, by sorted unique keys.
  void keep_voxels() {
    Points& points = cloud_.points;
    constexpr std::int64_t kHalf = 1 << 20;
    keys_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto cell = [this](float v) {
        return static_cast<std::int64_t>(std::floor(v / voxel_)) + kHalf;
      };
      keys_.push_back(cell(points.x[i]) << 42 | cell(points.y[i]) << 21 | cell(points.z[i]));
    }
    std::sort(keys_.begin(), keys_.end());
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
    const auto middle = [this](std::int64_t cell) {
      return (static_cast<float>((cell & (2 * kHalf - 1)) - kHalf) + 0.5F) * voxel_;
    };
    points.x.resize(keys_.size());
    points.y.resize(keys_.size());
    points.z.resize(keys_.size());
    for (std::size_t i = 0; i < keys_.size(); ++i) {
      points.x[i] = middle(keys_[i] >> 42);
      points.y[i] = middle(keys_[i] >> 21);
      points.z[i] = middle(keys_[i]);
    }
  }

  float voxel_;
  std::vector<std::int64_t> keys_;
  Cloud cloud_;
  std::optional<Tree> tree_;
};

}  // namespace

void add_nanoflann(const SphereSet& spheres, Methods* methods) {
  for (const float voxel : {0.0F, 0.01F}) {
    methods->push_back(std::make_unique<Nanoflann>(spheres, voxel));
  }
}

}  // namespace ist::benchmark
