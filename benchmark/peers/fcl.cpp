#include <fcl/fcl.h>

#include <algorithm>

#include "peers/method.h"

// FCL's dual-tree distance: the link's mesh against the points as triangles without area.
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
  explicit Fcl(const Robot& robot) : links_(models_of(robot)) {
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

  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override {
    const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      fcl::DistanceRequestd request;
      request.enable_nearest_points = true;
      fcl::DistanceResultd result;
      fcl::distance(links_[link].get(), X_FL[link], cloud_.get(), identity, request, result);
      // Negative: the volumes overlap; FCL does not compute by how much.
      (*answers)[link] = {std::max(0.0, result.min_distance), result.nearest_points[0],
                          result.nearest_points[1]};
    }
  }

 private:
  std::vector<std::shared_ptr<Model>> links_;
  Points points_;
  std::unique_ptr<Model> cloud_;
};

}  // namespace

void add_fcl(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<Fcl>(robot));
}

}  // namespace ist::benchmark
