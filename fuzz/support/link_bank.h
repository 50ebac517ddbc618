#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "internal/bvh/build_id.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/robot_of_links.h"

/// Links that are packed once for all executions of a fuzz target: packing takes a hundred times as
/// long as the queries of a small case.
namespace ist::fuzz {

/// Primitives, closed, thin, crossing and compound meshes, and meshes with holes.
inline std::vector<LinkGeometry> bank_geometries() {
  const auto one = [](const Shape& shape) {
    return LinkGeometry{GeometryElement{shape, Eigen::Isometry3d::Identity(), "bank"}};
  };
  Eigen::Isometry3d X_LE = Eigen::Isometry3d::Identity();
  X_LE.translation() = Eigen::Vector3d(0.03, 0.02, -0.04);
  X_LE.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  LinkGeometry compound = one(test::box({0.1, 0.06, 0.04}));
  compound.push_back({test::l_shape(0.1, 0.03), X_LE, "bank"});
  TriangleMesh cup = test::icosphere(0.1, 0);
  cup.triangles.resize(13);
  TriangleMesh lump = test::icosphere(0.1, 0);
  for (std::size_t i = 0; i < lump.vertices.size(); i += 3) lump.vertices[i] *= 0.4;
  return {one(test::box({0.2, 0.1, 0.05})),
          one(test::l_shape(0.2, 0.04)),
          one(lump),
          one(test::thin_plate(0.2, 1e-4)),
          one(test::needle(0.3, 0.005)),
          compound,
          one(test::joined(test::box({0.2, 0.1, 0.05}), test::l_shape(0.1, 0.05))),
          one(test::open_box({0.1, 0.1, 0.1})),
          one(cup),
          one(test::sheet(0.2)),
          one(Box{{0.2, 0.1, 0.05}}),
          one(Cylinder{0.05, 0.2}),
          one(Sphere{0.1})};
}

/// The bank as the links of one robot, in two packings of the same geometry.
struct LinkBank {
  std::vector<LinkGeometry> geometries;
  std::shared_ptr<const RobotModel> coarse, fine;
};

inline std::shared_ptr<RobotModel> pack_bank(const std::vector<LinkGeometry>& geometries,
                                             double max_error) {
  RobotModelConfig config;
  config.packing.max_error = max_error;
  config.packing.max_spheres = 100;
  config.threads = 1;
  return std::make_shared<RobotModel>(*build_robot_model(test::robot_of(geometries), config));
}

inline const LinkBank& link_bank() {
  static const LinkBank kBank = [] {
    const std::vector<LinkGeometry> geometries = bank_geometries();
    const auto coarse = pack_bank(geometries, 0.05), fine = pack_bank(geometries, 0.01);
    coarse->geometry_id = fine->geometry_id = next_build_id();
    for (std::size_t i = 0; i < geometries.size(); ++i) {
      fine->links[i].solid = coarse->links[i].solid;
      coarse->links[i].packing_id = next_build_id();
      fine->links[i].packing_id = next_build_id();
    }
    return LinkBank{geometries, coarse, fine};
  }();
  return kBank;
}

/// One link of the bank as a robot, so that a query has working memory for no other.
struct BankLink {
  const LinkGeometry* geometry;
  std::shared_ptr<const RobotModel> coarse, fine;
};

inline const BankLink& bank_link(std::size_t index) {
  static const std::vector<BankLink> kLinks = [] {
    const LinkBank& bank = link_bank();
    std::vector<BankLink> links;
    for (std::size_t i = 0; i < bank.geometries.size(); ++i) {
      const auto alone = [i](const RobotModel& model) {
        auto robot = std::make_shared<RobotModel>();
        robot->links = {model.links[i]};
        robot->geometry_id = model.geometry_id + i;
        return robot;
      };
      links.push_back({&bank.geometries[i], alone(*bank.coarse), alone(*bank.fine)});
    }
    return links;
  }();
  return kLinks[index % kLinks.size()];
}

}  // namespace ist::fuzz
