#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nanoflann.hpp>
#include <optional>
#include <vector>

#include "peers/method.h"

// Links as spheres, and a k-d tree over all points, or over the centres of occupied voxels, queried
// for the point nearest to each sphere.
namespace ist::benchmark {
namespace {

// [m] With it the Panda gets 59 spheres, as many as a common hand-made set for this arm has.
constexpr double kSphereError = 0.04107;

// Inner spheres of a packing instead of the links.
struct SphereSet {
  explicit SphereSet(const Robot& robot) : model(robot.pack(kSphereError)) {
    for (const LinkModel& link : model->links) {
      size += link.packing.spheres.size();
      gap = std::max(gap, link.packing.certificate.max_gap);
    }
  }
  std::shared_ptr<const RobotModel> model;
  std::size_t size = 0;
  double gap = 0.0;  // [m] no surface point is farther from the spheres
};

struct Cloud {
  std::vector<Eigen::Vector3f> points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3>;

class Nanoflann : public Method {
 public:
  // @param voxel  [m] edge of the voxels; 0: all points
  Nanoflann(const SphereSet& set, float voxel) : set_(set), voxel_(voxel) {
    name = voxel > 0.0F ? "nanoflann on voxels of 1 cm" : "nanoflann";
    kind = "spheres";
    spheres = set.size;
    const double off = 0.5 * std::sqrt(3.0) * static_cast<double>(voxel);
    largest_error = set.gap + off + kRounding;
    least_error = -set.gap - off;
  }

  void ingest(const Frame& frame) override {
    tree_.reset();
    read_points(frame, &cloud_.points);
    if (voxel_ > 0.0F) keep_voxels();
    tree_.emplace(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    tree_->buildIndex();
  }

  // The nearest point of each sphere is searched within the distance of the best sphere so far.
  void query(const Poses& X_FL, std::vector<Answer>* answers) override {
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      Answer& best = (*answers)[link];
      best.distance = std::numeric_limits<double>::infinity();
      for (const InnerSphere& sphere : set_.model->links[link].packing.spheres) {
        const Eigen::Vector3d center = X_FL[link] * sphere.center;
        const double max_distance = best.distance + sphere.radius;
        if (max_distance <= 0.0) continue;
        const auto point = nearest(center, max_distance);
        if (!point) continue;
        const Eigen::Vector3d offset = *point - center;
        const double distance = offset.norm();
        if (distance >= max_distance) continue;
        const Eigen::Vector3d direction =
            distance > 0.0 ? Eigen::Vector3d(offset / distance) : Eigen::Vector3d::UnitZ();
        best = {distance - sphere.radius, center + sphere.radius * direction, *point};
      }
    }
  }

 private:
  // None where no point is within `max_distance` [m].
  std::optional<Eigen::Vector3d> nearest(const Eigen::Vector3d& center, double max_distance) {
    const Eigen::Vector3f c = center.cast<float>();
    std::size_t index = 0;
    float distance_sq = 0.0F;
    nanoflann::KNNResultSet<float> result(1);
    result.init(&index, &distance_sq);
    if (max_distance < 1e15) distance_sq = static_cast<float>(max_distance * max_distance);
    tree_->findNeighbors(result, c.data(), nanoflann::SearchParams());
    if (result.size() == 0) return std::nullopt;
    return cloud_.points[index].cast<double>();
  }

  // The points become the centres of occupied voxels, by sorted unique keys.
  void keep_voxels() {
    constexpr std::int64_t kHalf = 1 << 20;
    const auto cell = [this](float v) {
      return static_cast<std::int64_t>(std::floor(v / voxel_)) + kHalf;
    };
    const auto middle = [this](std::int64_t key) {
      return (static_cast<float>((key & (2 * kHalf - 1)) - kHalf) + 0.5F) * voxel_;
    };
    keys_.clear();
    for (const Eigen::Vector3f& p : cloud_.points) {
      keys_.push_back(cell(p.x()) << 42 | cell(p.y()) << 21 | cell(p.z()));
    }
    std::sort(keys_.begin(), keys_.end());
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
    cloud_.points.clear();
    for (const std::int64_t key : keys_) {
      cloud_.points.emplace_back(middle(key >> 42), middle(key >> 21), middle(key));
    }
  }

  SphereSet set_;
  float voxel_;
  std::vector<std::int64_t> keys_;
  Cloud cloud_;
  std::optional<Tree> tree_;
};

}  // namespace

void add_nanoflann(const Robot& robot, Methods* methods) {
  const SphereSet spheres(robot);
  for (const float voxel : {0.0F, 0.01F}) {
    methods->push_back(std::make_unique<Nanoflann>(spheres, voxel));
  }
}

}  // namespace ist::benchmark
