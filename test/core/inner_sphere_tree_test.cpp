#include "ist_proximity/tree/inner_sphere_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "internal/packing/packer.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr PackingOrder kOrders[] = {PackingOrder::kMedial, PackingOrder::kDisjoint,
                                    PackingOrder::kVolume};

struct NamedPacking {
  std::string name;
  Packing packing;
};

// Sets of spheres: some like those of packings, and unusual ones.
std::vector<NamedPacking> hard_spheres() {
  test::Rng rng(11);
  std::vector<NamedPacking> all;
  const auto add = [&](const std::string& name, int count, const auto& make) {
    Packing packing;
    for (int i = 0; i < count; ++i) {
      InnerSphere sphere = make(i);
      sphere.cover_radius = sphere.radius + test::uniform(&rng, 0.0, 0.005);
      packing.spheres.push_back(sphere);
    }
    all.push_back({name, packing});
  };
  const auto anywhere = [&](int) { return InnerSphere{test::random_vector(&rng, 0.2), 0.01, 0}; };
  for (const int count : {1, 2, 8, 9, 16, 17, 64, 65, 3000}) {
    add(std::to_string(count) + " anywhere", count, anywhere);
  }
  add("all at one place", 1000, [](int) { return InnerSphere{{0.1, 0.2, 0.3}, 0.01, 0}; });
  add("on a line", 500, [](int i) { return InnerSphere{{0.001 * i, 0, 0}, 0.002, 0}; });
  add("without radius", 500, [&](int) {
    return InnerSphere{test::random_vector(&rng, 0.2), 0.0, 0};
  });
  add("one giant, the rest dust", 2000, [&](int i) {
    return InnerSphere{test::random_vector(&rng, 0.2), i == 700 ? 1e3 : 1e-6, 0};
  });
  add("ever farther apart", 400, [](int i) {
    return InnerSphere{{1e-3 * std::pow(1.03, i), 0, 0}, 1e-3 * std::pow(1.03, i), 0};
  });
  add("ever nearer to a point", 2000, [](int i) {
    return InnerSphere{{std::pow(0.98, i), 0, 0}, 0.5 * std::pow(0.98, i), 0};
  });
  add("100 km away", 500, [&](int) {
    return InnerSphere{Eigen::Vector3d(1e5, 0, 0) + test::random_vector(&rng, 0.2), 0.01, 0};
  });
  return all;
}

std::vector<NamedPacking> packings() {
  const std::string folder = std::string(IST_PROXIMITY_SOURCE_DIR) + "/demo/meshes/";
  const Eigen::Vector3d millimetres = Eigen::Vector3d::Constant(0.001);
  const std::vector<std::pair<std::string, TriangleMesh>> meshes = {
      {"shoulder fork", load_mesh(folder + "shoulder_fork.stl", millimetres)},
      {"wrist fork", load_mesh(folder + "wrist_fork.obj")},
      {"torus", test::torus(0.1, 0.03, 32, 16)},
      {"open box", test::open_box({0.1, 0.1, 0.2})},
      {"sheet", test::sheet(0.1)}};
  std::vector<NamedPacking> all;
  for (const auto& [name, mesh] : meshes) {
    for (const PackingOrder order : kOrders) {
      PackingConfig config;
      config.order = order;
      config.max_error = test::packed_to(0.005);
      config.max_spheres = 200;
      all.push_back(
          {name + ", order " + std::to_string(static_cast<int>(order)), pack_mesh(mesh, config)});
    }
  }
  return all;
}

struct LeafSphere {
  Eigen::Vector3d center;
  double inner_radius, cover_radius;
};

// Collects all spheres in a child's subtree and checks its nodes.
class Walk {
 public:
  explicit Walk(const InnerSphereTree& tree) : tree_(tree) {}

  void check(std::int32_t node_index, int level) {
    deepest_ = std::max(deepest_, level);
    const SphereNode& node = tree_.nodes()[static_cast<std::size_t>(node_index)];
    ASSERT_GE(node.count, 1);
    ASSERT_LE(node.count, kSphereWidth);
    for (int k = 0; k < kSphereWidth; ++k) {
      if (k >= node.count) {
        ASSERT_LT(node.radius[k], -1e20F);
        continue;
      }
      const std::size_t first = spheres_.size();
      if (node.child[k] < 0) {
        add_leaf(~node.child[k], level + 1);
      } else {
        ASSERT_GT(node.child[k], node_index) << "nodes follow their parents";
        check(node.child[k], level + 1);
      }
      if (testing::Test::HasFatalFailure()) return;
      check_enclosed(node, k, first);
    }
  }

  const std::vector<LeafSphere>& spheres() const { return spheres_; }
  int deepest() const { return deepest_; }

 private:
  void add_leaf(std::int32_t index, int level) {
    deepest_ = std::max(deepest_, level);
    const SphereLeaf& leaf = tree_.leaves()[static_cast<std::size_t>(index)];
    ASSERT_GE(leaf.count, 1);
    ASSERT_LE(leaf.count, kSphereWidth);
    for (int k = 0; k < kSphereWidth; ++k) {
      if (k >= leaf.count) {
        ASSERT_LT(leaf.cover_radius[k], -1e20F);
        continue;
      }
      spheres_.push_back(
          {{leaf.x[k], leaf.y[k], leaf.z[k]}, leaf.inner_radius[k], leaf.cover_radius[k]});
    }
  }

  // A node's stored numbers enclose its leaves' stored numbers, evaluated in double.
  void check_enclosed(const SphereNode& node, int k, std::size_t first) const {
    const Eigen::Vector3d center(node.x[k], node.y[k], node.z[k]);
    for (std::size_t i = first; i < spheres_.size(); ++i) {
      const double extent = (spheres_[i].center - center).norm() + spheres_[i].cover_radius;
      ASSERT_LE(extent, node.radius[k] * (1.0 + 1e-14));
      ASSERT_LE(spheres_[i].inner_radius, node.max_inner[k]);
    }
  }

  const InnerSphereTree& tree_;
  std::vector<LeafSphere> spheres_;
  int deepest_ = 0;
};

// Sorted by position, because the tree's order does not matter.
bool before(const LeafSphere& a, const LeafSphere& b) {
  return std::make_tuple(a.center.x(), a.center.y(), a.center.z(), a.inner_radius, a.cover_radius) <
         std::make_tuple(b.center.x(), b.center.y(), b.center.z(), b.inner_radius, b.cover_radius);
}

// Volatile, because GCC 12 vectorizes two conversions, to float and back, into none at all.
Eigen::Vector3d in_float(const Eigen::Vector3d& p) {
  volatile float x = static_cast<float>(p.x()), y = static_cast<float>(p.y());
  volatile float z = static_cast<float>(p.z());
  return {x, y, z};
}

// Every sphere is in one leaf. Its inner sphere contains that of the leaf, and its cover sphere is
// in that of the leaf.
void expect_every_sphere(const Packing& packing, std::vector<LeafSphere> found) {
  ASSERT_EQ(found.size(), packing.spheres.size());
  std::vector<LeafSphere> given;
  for (const InnerSphere& sphere : packing.spheres) {
    const Eigen::Vector3d rounded = in_float(sphere.center);
    given.push_back({rounded, sphere.radius, sphere.cover_radius});
  }
  std::sort(found.begin(), found.end(), before);
  std::sort(given.begin(), given.end(), before);
  for (std::size_t i = 0; i < given.size(); ++i) {
    ASSERT_EQ(found[i].center, given[i].center);
  }
  for (const InnerSphere& sphere : packing.spheres) {
    const Eigen::Vector3d rounded = in_float(sphere.center);
    const double moved = (rounded - sphere.center).norm();
    const double inner = sphere.radius - moved, outer = sphere.cover_radius + moved;
    const double rounding = 1e-15 * (1.0 + outer), resolution = 2.5e-7 * (1.0 + outer);
    const auto matches = [&](const LeafSphere& leaf) {
      return leaf.center == rounded && leaf.inner_radius <= inner + rounding &&
             leaf.inner_radius >= inner - resolution && leaf.cover_radius >= outer - rounding &&
             leaf.cover_radius <= outer + resolution;
    };
    LeafSphere key{rounded, -std::numeric_limits<double>::infinity(), 0.0};
    auto at = std::lower_bound(found.begin(), found.end(), key, before);
    while (at != found.end() && at->center == rounded && !matches(*at)) ++at;
    ASSERT_TRUE(at != found.end() && at->center == rounded) << sphere.center.transpose();
  }
}

void expect_sound(const Packing& packing) {
  const InnerSphereTree tree(packing);
  Walk walk(tree);
  walk.check(0, 1);
  if (testing::Test::HasFatalFailure()) return;
  EXPECT_LE(walk.deepest(), kMaxTreeLevels);
  expect_every_sphere(packing, walk.spheres());
  for (const LeafSphere& sphere : walk.spheres()) {
    ASSERT_LE((sphere.center - tree.center()).norm() + sphere.cover_radius,
              tree.radius() * (1.0 + 1e-14));
  }
}

TEST(InnerSphereTree, EveryNodeEnclosesItsLeaves) {
  for (const auto& list : {hard_spheres(), packings()}) {
    for (const auto& [name, packing] : list) {
      SCOPED_TRACE(name);
      expect_sound(packing);
      if (HasFatalFailure()) return;
    }
  }
}

}  // namespace
}  // namespace ist
