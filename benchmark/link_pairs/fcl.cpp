#include "link_pairs/fcl.h"

#include "fcl_geometry.h"

namespace ist::benchmark {

std::function<double(const LinkPair&, const std::vector<Eigen::Isometry3d>&)> fcl_distances(
    const Robot& robot) {
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> models;
  for (const auto& triangles : robot.triangles) {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<fcl::Triangle> faces;
    for (const auto& t : triangles) {
      const std::size_t first = vertices.size();
      vertices.insert(vertices.end(), t.p, t.p + 3);
      faces.emplace_back(first, first + 1, first + 2);
    }
    models.push_back(fcl_mesh(vertices, faces));
  }
  return [models](const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL) {
    fcl::DistanceRequestd request;
    request.enable_nearest_points = true;
    fcl::DistanceResultd result;
    return fcl::distance(models[pair.first].get(), X_FL[pair.first], models[pair.second].get(),
                         X_FL[pair.second], request, result);
  };
}

}  // namespace ist::benchmark
