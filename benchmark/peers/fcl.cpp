#include <algorithm>

#include "fcl_geometry.h"
#include "peers/method.h"

// FCL's dual-tree distance: the link's mesh against the points as triangles without area.
namespace ist::benchmark {
namespace {

class Fcl : public Method {
 public:
  explicit Fcl(const Robot& robot) {
    name = "FCL, mesh and point triangles";
    is_unsigned = true;
    for (const TriangleMesh& mesh : robot.meshes) links_.push_back(fcl_geometry(mesh));
  }

  void ingest(const Frame& frame) override {
    read_points(frame, &points_);
    std::vector<Eigen::Vector3d> vertices;
    std::vector<fcl::Triangle> triangles;
    vertices.reserve(points_.size());
    triangles.reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      vertices.emplace_back(points_[i].cast<double>());
      triangles.emplace_back(i, i, i);
    }
    cloud_ = fcl_mesh(vertices, triangles);
  }

  void query(const Poses& X_FL, std::vector<Answer>* answers) override {
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
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> links_;
  std::vector<Eigen::Vector3f> points_;
  std::shared_ptr<fcl::CollisionGeometryd> cloud_;
};

}  // namespace

void add_fcl(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<Fcl>(robot));
}

}  // namespace ist::benchmark
