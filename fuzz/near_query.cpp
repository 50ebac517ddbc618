// Queries near a link and inside it, where the single-tree traversal takes over: points next to the
// surface, poses one after the other, packings and clouds that change in between, deadlines that
// have passed, against brute force in double.
// Covers: src/proximity/single_tree_search.cpp src/proximity/link_query.cpp
// Covers: src/proximity/signed_distance_grid.cpp src/proximity/refinement_points.cpp
// Covers: src/proximity/coherence src/geometry/outside_margin.cpp
// Longest input: 500

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/broken_promise.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/link_bank.h"
#include "support/meshes_from_bytes.h"
#include "support/query_config_from_bytes.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace {

using ist::fuzz::ByteReader;
using Points = std::vector<Eigen::Vector3d>;

constexpr double kSize = 0.2;  // [m] of the links, about

/// Points about a link, in its frame: next to its surface, all at one distance from it, or
/// anywhere.
Points points_from(ByteReader* in, const ist::LinkGeometry& link) {
  const auto* mesh = std::get_if<ist::TriangleMesh>(&link[0].shape);
  const std::size_t kind = in->below(4), count = 1 + in->below(48);
  const double offset = kind == 0 ? kSize * std::pow(10.0, in->between(-6.0, 0.0)) : 0.0;
  Points points;
  while (points.size() < count) {
    if (mesh == nullptr || kind == 3) {
      points.push_back(in->vector(0.3));
    } else if (kind == 0) {
      const std::size_t t = in->below(mesh->triangles.size());
      const Eigen::Vector3d a = mesh->corner(t, 0), b = mesh->corner(t, 1), c = mesh->corner(t, 2);
      const double u = in->between(0.0, 1.0);
      const Eigen::Vector3d n = (b - a).cross(c - a).normalized();
      points.push_back(link[0].X_LE * ((1.0 - u) * a + 0.5 * u * (b + c) + offset * n));
    } else {
      points.push_back(link[0].X_LE * ist::fuzz::point_near(*mesh, kSize, in));
    }
  }
  return points;
}

struct Cloud {
  Points points;  // in the fixed frame
  ist::CloudSnapshot snapshot;
};

Cloud cloud_from(ByteReader* in, const ist::LinkGeometry& link, const Eigen::Isometry3d& X_FL) {
  Cloud cloud;
  for (const Eigen::Vector3d& p_L : points_from(in, link)) cloud.points.push_back(X_FL * p_L);
  cloud.snapshot = ist::test::make_snapshot(cloud.points, X_FL.translation());
  return cloud;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const ist::fuzz::BankLink& link = ist::fuzz::bank_link(in.byte());
  Eigen::Isometry3d X_FL = in.pose(1.0);
  std::vector<Cloud> clouds;
  for (std::size_t i = 1 + in.below(3) / 2; i > 0; --i) {
    clouds.push_back(cloud_from(&in, *link.geometry, X_FL));
  }
  ist::ProximityQuery query(in.flag() ? link.coarse : link.fine, {});
  ist::QueryConfig config = ist::fuzz::query_config_from(&in);
  ist::LinkProximity answer;
  for (std::size_t step = 2 + in.below(6); step > 0; --step) {
    const std::uint8_t changes = in.byte();
    if ((changes & 1U) != 0) X_FL = X_FL * in.pose(std::pow(10.0, in.between(-7.0, -0.7)));
    if ((changes & 2U) != 0) config = ist::fuzz::query_config_from(&in);
    if ((changes & 4U) != 0) query.set_model((changes & 8U) != 0 ? link.coarse : link.fine);
    if ((changes & 16U) != 0 && (changes & 32U) != 0) {
      clouds[in.below(clouds.size())] = cloud_from(&in, *link.geometry, X_FL);
    }
    ist::test::SceneTruth truth;
    truth.is_closed = link.coarse->links[0].solid.is_closed();
    truth.scale = 1.0 + X_FL.translation().norm();
    std::vector<const ist::CloudSnapshot*> snapshots;
    for (const Cloud& cloud : clouds) {
      snapshots.push_back(&cloud.snapshot);
      truth.measured.add(ist::test::truth_interval(*link.geometry, X_FL, cloud.points));
      truth.stored.add(ist::test::truth_interval(*link.geometry, X_FL,
                                                 ist::test::stored_points(cloud.snapshot.index)));
    }
    query.set_config(config);
    const ist::SnapshotSpan span(snapshots.data(), snapshots.size());
    bool is_complete;
    if ((changes & 64U) != 0) {
      std::vector<ist::LinkProximity> answers;
      is_complete = query.run(std::vector<Eigen::Isometry3d>{X_FL}, {true}, span, &answers);
      answer = answers[0];
    } else {
      is_complete = query.run_link(0, X_FL, span, &answer);
    }
    FUZZ_CHECK(is_complete || config.deadline == ist::fuzz::kPassed,
               "there was time, and not complete");
    const std::string broken = ist::test::broken_promise(answer, truth, config, is_complete);
    FUZZ_CHECK(broken.empty(), "%s", broken.c_str());
  }
  return 0;
}
