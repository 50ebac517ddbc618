#include <fcl/fcl.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "peers/method.h"

// FCL's dual-tree distance: the link's mesh against the points as triangles without area, and
// against an octree of 1 cm.
namespace ist::benchmark {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

std::vector<std::shared_ptr<Model>> models_of(const Robot& robot) {
  std::vector<std::shared_ptr<Model>> models;
  for (const TriangleMesh& mesh : robot.meshes) {
    std::vector<fcl::Triangle> triangles;
    for (const TriangleMesh::Triangle& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
    models.push_back(std::make_shared<Model>());
    models.back()->beginModel(static_cast<int>(triangles.size()),
                              static_cast<int>(mesh.vertices.size()));
    models.back()->addSubModel(mesh.vertices, triangles);
    models.back()->endModel();
  }
  return models;
}

class Fcl : public Method {
 public:
  explicit Fcl(const Robot& robot) : links_(models_of(robot)) {}

  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override {
    const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      fcl::DistanceRequestd request;
      request.enable_nearest_points = true;
      fcl::DistanceResultd result;
      fcl::distance(links_[link].get(), X_FL[link], obstacle(), identity, request, result);
      // Negative: the volumes overlap; FCL does not compute by how much.
      (*answers)[link] = {std::max(0.0, result.min_distance), result.nearest_points[0],
                          result.nearest_points[1]};
    }
  }

 protected:
  virtual const fcl::CollisionGeometryd* obstacle() const = 0;

 private:
  std::vector<std::shared_ptr<Model>> links_;
};

class FclPoints : public Fcl {
 public:
  explicit FclPoints(const Robot& robot) : Fcl(robot) {
    name = "FCL, mesh and point triangles";
    kind = Kind::kExact;
    is_unsigned = true;
  }

  void ingest(const Frame& frame) override {
    points_.read(frame);
    std::vector<Eigen::Vector3d> vertices;
    std::vector<fcl::Triangle> triangles;
    vertices.reserve(points_.size());
    triangles.reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      vertices.emplace_back(points_.at(i).cast<double>());
      triangles.emplace_back(i, i, i);
    }
    cloud_ = std::make_unique<Model>();
    cloud_->beginModel(static_cast<int>(triangles.size()), static_cast<int>(vertices.size()));
    cloud_->addSubModel(vertices, triangles);
    cloud_->endModel();
  }

 protected:
  const fcl::CollisionGeometryd* obstacle() const override { return cloud_.get(); }

 private:
  Points points_;
  std::unique_ptr<Model> cloud_;
};

class FclOctree : public Fcl {
 public:
  explicit FclOctree(const Robot& robot) : Fcl(robot) {
    name = "FCL, mesh and octree of 1 cm";
    kind = Kind::kGrid;
    every = 25;
    // A cell extends no farther from its points than its diagonal.
    least_error = -std::sqrt(3.0) * kCell - kRounding;
    witness_error = std::numeric_limits<double>::infinity();  // FCL gives none
  }

  void ingest(const Frame& frame) override {
    points_.read(frame);
    auto tree = std::make_shared<octomap::OcTree>(kCell);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3f p = points_.at(i);
      tree->setNodeValue(p.x(), p.y(), p.z(), tree->getClampingThresMaxLog(), true);
    }
    tree->updateInnerOccupancy();
    tree_ = std::make_unique<fcl::OcTreed>(tree);
  }

 protected:
  const fcl::CollisionGeometryd* obstacle() const override { return tree_.get(); }

 private:
  static constexpr double kCell = 0.01;  // [m]

  Points points_;
  std::unique_ptr<fcl::OcTreed> tree_;
};

}  // namespace

void add_fcl(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<FclPoints>(robot));
  methods->push_back(std::make_unique<FclOctree>(robot));
}

}  // namespace ist::benchmark
