#include <dynamicEDT3D/dynamicEDTOctomap.h>
#include <octomap/octomap.h>

#include <cmath>
#include <memory>

#include "peers/flat.h"

// A distance field on a grid of 2 cm around the robot, looked up at each sphere's centre.
namespace ist::benchmark {
namespace {

class DynamicEdt : public BySpheres {
 public:
  explicit DynamicEdt(const SphereSet& set) : BySpheres(set) {
    name = "dynamicEDT3D of 2 cm";
    kind = Kind::kGrid;
    // The distance from the centre of the sphere's cell to that of the nearest point's cell.
    const double diagonal = std::sqrt(3.0) * kCell;
    least_error = -set.gap - diagonal;
    largest_error = set.gap + diagonal;
    witness_error = diagonal;
  }

  void ingest(const Frame& frame) override {
    points_.read(frame);
    field_.reset();
    tree_ = std::make_unique<octomap::OcTree>(kCell);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3f p = points_.at(i);
      tree_->setNodeValue(p.x(), p.y(), p.z(), tree_->getClampingThresMaxLog(), true);
    }
    tree_->updateInnerOccupancy();
    const float r = kReach;
    field_ = std::make_unique<DynamicEDTOctomap>(
        kFarthest, tree_.get(), octomap::point3d(-r, -r, -r), octomap::point3d(r, r, r), false);
    field_->update();
  }

 protected:
  bool nearest(const Eigen::Vector3d& center, double /*max_distance*/, Nearest* found) override {
    const Eigen::Vector3f c = center.cast<float>();
    float distance = 0.0F;
    octomap::point3d cell;
    field_->getDistanceAndClosestObstacle(octomap::point3d(c.x(), c.y(), c.z()), distance, cell);
    *found = {{cell.x(), cell.y(), cell.z()}, static_cast<double>(distance)};
    return distance >= 0.0F;  // else outside the grid
  }

 private:
  static constexpr double kCell = 0.02;     // [m]
  static constexpr float kReach = 1.3F;     // [m] of the robot
  static constexpr float kFarthest = 2.0F;  // [m] larger distances are not known

  Points points_;
  std::unique_ptr<octomap::OcTree> tree_;
  std::unique_ptr<DynamicEDTOctomap> field_;
};

}  // namespace

void add_dynamic_edt(const SphereSet& spheres, Methods* methods) {
  methods->push_back(std::make_unique<DynamicEdt>(spheres));
}

}  // namespace ist::benchmark
