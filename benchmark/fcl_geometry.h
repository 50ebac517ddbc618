#pragma once

#include <fcl/fcl.h>

#include <memory>
#include <variant>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist::benchmark {

/// A mesh as FCL has it: a hierarchy of OBBRSS boxes.
inline std::shared_ptr<fcl::CollisionGeometryd> fcl_mesh(
    const std::vector<Eigen::Vector3d>& vertices, const std::vector<fcl::Triangle>& faces) {
  auto model = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  model->beginModel(static_cast<int>(faces.size()), static_cast<int>(vertices.size()));
  model->addSubModel(vertices, faces);
  model->endModel();
  return model;
}

/// A shape as FCL has it.
inline std::shared_ptr<fcl::CollisionGeometryd> fcl_geometry(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) return std::make_shared<fcl::Boxd>(box->size);
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return std::make_shared<fcl::Cylinderd>(cylinder->radius, cylinder->length);
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return std::make_shared<fcl::Sphered>(sphere->radius);
  }
  const auto& mesh = std::get<TriangleMesh>(shape);
  std::vector<fcl::Triangle> faces;
  for (const auto& t : mesh.triangles) faces.emplace_back(t[0], t[1], t[2]);
  return fcl_mesh(mesh.vertices, faces);
}

}  // namespace ist::benchmark
