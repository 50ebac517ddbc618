#include "support/random_links.h"

#include <cmath>
#include <variant>

#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/robot_of_links.h"
#include "support/sanitizers.h"

namespace ist::test {

TriangleMesh random_lump(Rng* rng) {
  TriangleMesh mesh = icosphere(0.1, 1);
  for (Eigen::Vector3d& v : mesh.vertices) v *= uniform(rng, 0.3, 1.2);
  return mesh;
}

TriangleMesh random_soup(Rng* rng, int count) {
  MeshBuilder builder;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d middle = random_vector(rng, 0.08);
    builder.triangle(middle + random_vector(rng, 0.08), middle + random_vector(rng, 0.08),
                     middle + random_vector(rng, 0.08));
  }
  return builder.mesh();
}

LinkGeometry one(const Shape& shape) {
  return {GeometryElement{shape, Eigen::Isometry3d::Identity(), "test"}};
}

LinkGeometry random_compound(Rng* rng) {
  LinkGeometry link;
  for (const Shape& shape : std::vector<Shape>{Box{{0.1, 0.06, 0.04}}, Cylinder{0.03, 0.15},
                                               Sphere{0.05}, l_shape(0.1, 0.03)}) {
    link.push_back(GeometryElement{shape, random_pose(rng, 0.06), "test"});
  }
  return link;
}

std::vector<LinkGeometry> random_links(Rng* rng) {
  std::vector<LinkGeometry> links = {one(Box{{0.2, 0.1, 0.05}}),
                                     one(Cylinder{0.05, 0.2}),
                                     one(Cylinder{0.15, 0.002}),
                                     one(Sphere{0.1}),
                                     one(box({0.2, 0.1, 0.05})),
                                     one(l_shape(0.2, 0.04)),
                                     one(torus(0.1, 0.03, 10, 6)),
                                     one(thin_plate(0.2, 1e-4)),
                                     one(needle(0.3, 0.005)),
                                     one(joined(box({0.2, 0.1, 0.05}), l_shape(0.1, 0.05))),
                                     one(inside_out(box({0.1, 0.1, 0.1})))};
  for (int i = 0; i < 4; ++i) links.push_back(one(random_lump(rng)));
  for (int i = 0; i < 2; ++i) links.push_back(random_compound(rng));
  links.push_back(one(sheet(0.2)));
  links.push_back(one(open_box({0.1, 0.1, 0.1})));
  links.push_back(one(open_box({0.2, 0.1, 0.05})));
  TriangleMesh cup = icosphere(0.1, 1);  // a third of its faces are missing
  cup.triangles.resize(cup.triangles.size() * 2 / 3);
  links.push_back(one(cup));
  for (int i = 0; i < 3; ++i) links.push_back(one(random_soup(rng, 8)));
  return links;
}

std::shared_ptr<const RobotModel> model_of(const std::vector<LinkGeometry>& links,
                                           double max_error) {
  RobotModelConfig config;
  config.packing.max_error = packed_to(max_error);
  return build_robot_model(robot_of(links), config);
}

std::vector<Eigen::Vector3d> random_points(Rng* rng, const LinkGeometry& link, int count) {
  const int kind = static_cast<int>(uniform(rng, 0, 6));
  const Eigen::Vector3d middle = random_vector(rng, 0.15), u = random_vector(rng, 0.3),
                        v = random_vector(rng, 0.3);
  const double size = std::pow(10.0, uniform(rng, -4, -0.5));
  const auto* mesh = std::get_if<TriangleMesh>(&link[0].shape);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double s = uniform(rng, -1, 1), t = uniform(rng, -1, 1);
    if (kind == 0) {
      points.push_back(middle + s * u + t * v);
    } else if (kind == 1) {
      points.push_back(middle + s * u);
    } else if (kind == 2) {
      points.push_back(middle + random_vector(rng, size));
    } else if (kind == 3 && mesh != nullptr) {
      const auto triangle = static_cast<std::size_t>(uniform(rng, 0, 1) *
                                                     static_cast<double>(mesh->triangles.size()));
      const double a = uniform(rng, 0, 1), b = uniform(rng, 0, 1 - a);
      points.push_back(link[0].X_LE *
                           ((1 - a - b) * mesh->corner(triangle, 0) +
                            a * mesh->corner(triangle, 1) + b * mesh->corner(triangle, 2)) +
                       random_vector(rng, size));
    } else {
      points.push_back(random_vector(rng, kind == 4 ? 0.12 : 0.6));
    }
  }
  return points;
}

}  // namespace ist::test
