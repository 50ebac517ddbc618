#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/octree/octree_search.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "peers/flat.h"

// PCL's k-d tree (FLANN's) and its octree over all points, queried for the point nearest to each
// sphere.
namespace ist::benchmark {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

class PclMethod : public BySpheres {
 public:
  explicit PclMethod(const SphereSet& set) : BySpheres(set) {
    kind = Kind::kSpheres;
    largest_error = set.gap + kRounding;
    least_error = -set.gap;
  }

  void ingest(const Frame& frame) override {
    points_.read(frame);
    cloud_.reset(new Cloud);
    cloud_->reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      cloud_->push_back({points_.x[i], points_.y[i], points_.z[i]});
    }
    build();
  }

 protected:
  virtual void build() = 0;
  virtual bool find(const pcl::PointXYZ& center, double max_distance) = 0;

  bool nearest(const Eigen::Vector3d& center, double max_distance, Nearest* found) override {
    const Eigen::Vector3f c = center.cast<float>();
    if (!find({c.x(), c.y(), c.z()}, max_distance)) return false;
    found->p_FCo = points_.at(static_cast<std::size_t>(index_[0])).cast<double>();
    found->distance = (found->p_FCo - center).norm();
    return true;
  }

  Points points_;
  Cloud::Ptr cloud_;
  std::vector<int> index_{0};
  std::vector<float> distance_sq_{0.0F};
};

class KdTree : public PclMethod {
 public:
  explicit KdTree(const SphereSet& set) : PclMethod(set) { name = "PCL k-d tree"; }

 private:
  void build() override { tree_.setInputCloud(cloud_); }
  bool find(const pcl::PointXYZ& center, double max_distance) override {
    // With an upper bound, a radius search for at most one neighbour: FLANN keeps the nearest.
    if (std::isfinite(max_distance)) {
      return tree_.radiusSearch(center, max_distance, index_, distance_sq_, 1) > 0;
    }
    return tree_.nearestKSearch(center, 1, index_, distance_sq_) > 0;
  }

  pcl::KdTreeFLANN<pcl::PointXYZ> tree_;
};

class Octree : public PclMethod {
 public:
  explicit Octree(const SphereSet& set) : PclMethod(set) { name = "PCL octree of 2 cm"; }

 private:
  void build() override {
    tree_.emplace(0.02);
    tree_->setInputCloud(cloud_);
    tree_->addPointsFromInputCloud();
  }
  // The octree's radius search would stop at the first point, not at the nearest.
  bool find(const pcl::PointXYZ& center, double /*max_distance*/) override {
    return tree_->nearestKSearch(center, 1, index_, distance_sq_) > 0;
  }

  std::optional<pcl::octree::OctreePointCloudSearch<pcl::PointXYZ>> tree_;
};

}  // namespace

void add_pcl(const SphereSet& spheres, Methods* methods) {
  methods->push_back(std::make_unique<KdTree>(spheres));
  methods->push_back(std::make_unique<Octree>(spheres));
}

}  // namespace ist::benchmark
