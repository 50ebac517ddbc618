// A whole query from bytes: tiny links, points and boxes, poses one after the other, against brute
// force in double.
// Covers: src/proximity src/packing src/tree src/bvh src/geometry src/repulsion
// Longest input: 600

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <unordered_map>
#include <variant>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/box_oracle.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/meshes_from_bytes.h"
#include "support/robot_of_links.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/truth_interval.h"

namespace {

using ist::fuzz::ByteReader;
using Points = std::vector<Eigen::Vector3d>;

constexpr double kInf = std::numeric_limits<double>::infinity();

ist::Shape shape_from(ByteReader* in) {
  const auto size = [in] { return std::max(1e-4, ist::fuzz::length(in)); };
  switch (in->below(6)) {
    case 0:
      return ist::Box{{size(), size(), size()}};
    case 1: {
      const double radius = size();
      return ist::Cylinder{radius, size()};
    }
    case 2:
      return ist::Sphere{size()};
    default:
      return ist::fuzz::mesh_from(in);
  }
}

ist::LinkGeometry link_from(ByteReader* in) {
  ist::LinkGeometry link;
  for (std::size_t i = 1 + in->below(4) / 3; i > 0; --i) {
    const Eigen::Isometry3d X_LE = in->flag() ? in->pose(0.2) : Eigen::Isometry3d::Identity();
    link.push_back({shape_from(in), X_LE, "fuzz"});
  }
  return link;
}

double extent(const ist::Shape& shape) {
  if (const auto* box = std::get_if<ist::Box>(&shape)) return box->size.norm();
  if (const auto* cylinder = std::get_if<ist::Cylinder>(&shape)) {
    return 2.0 * cylinder->radius + cylinder->length;
  }
  if (const auto* sphere = std::get_if<ist::Sphere>(&shape)) return 2.0 * sphere->radius;
  return ist::fuzz::extent(std::get<ist::TriangleMesh>(shape));
}

/// The packing's settings. Coarse packings: they take most of the time, and bounds must hold for
/// any.
ist::RobotModelConfig packing_from(const std::vector<ist::LinkGeometry>& links, ByteReader* in) {
  double size = 0.0;
  for (const ist::LinkGeometry& geometry : links) {
    for (const ist::GeometryElement& element : geometry)
      size = std::max(size, extent(element.shape));
  }
  ist::RobotModelConfig config;
  config.packing.max_error = size * in->between(0.1, 1.0);
  config.packing.max_spheres = 1 + static_cast<int>(in->below(30));
  config.threads = 1;
  return config;
}

/// The model of links and a packing, kept from execution to execution: most inputs that libFuzzer
/// tries differ from others in what comes after the links.
/// @param key  the bytes that the links were made of
std::shared_ptr<const ist::RobotModel> model_of(const std::string& key,
                                                const std::vector<ist::LinkGeometry>& links,
                                                ByteReader* in) {
  constexpr std::size_t kKept = 512;
  static std::unordered_map<std::string, std::shared_ptr<const ist::RobotModel>> kept;
  const ist::RobotModelConfig config = packing_from(links, in);
  const std::string whole_key = key + "/" + std::to_string(config.packing.max_error) + "/" +
                                std::to_string(config.packing.max_spheres);
  const auto found = kept.find(whole_key);
  if (found != kept.end()) return found->second;
  if (kept.size() >= kKept) kept.clear();
  return kept.emplace(whole_key, ist::build_robot_model(ist::test::robot_of(links), config))
      .first->second;
}

using ist::test::truth_interval;
using Truth = ist::test::TruthInterval;

Points points_from(ByteReader* in, const ist::LinkGeometry& link) {
  Points points;
  const auto* mesh = std::get_if<ist::TriangleMesh>(&link[0].shape);
  for (std::size_t i = in->below(32); i > 0; --i) {
    points.push_back(mesh != nullptr && !mesh->triangles.empty()
                         ? link[0].X_LE * ist::fuzz::point_near(*mesh, ist::fuzz::extent(*mesh), in)
                         : in->vector(0.8));
  }
  return points;
}

/// Points of a map's boxes, at corners and within: the truth is no larger than their distance.
Points samples_of(const std::vector<Eigen::AlignedBox3d>& boxes) {
  Points points;
  for (const Eigen::AlignedBox3d& box : boxes) {
    for (int i = 0; i < 27; ++i) {
      const Eigen::Vector3d at(i % 3, i / 3 % 3, i / 9);
      points.push_back(box.min() + 0.5 * at.cwiseProduct(box.sizes()));
    }
  }
  return points;
}

struct Scene {
  std::vector<ist::LinkGeometry> links;
  std::string key;  ///< the bytes that the links were made of
  Points points;    ///< in the fixed frame
  Points samples;   ///< of the boxes
  ist::CloudSnapshot cloud, map;
  std::vector<const ist::CloudSnapshot*> snapshots;
};

void check_answer(const ist::LinkProximity& answer, const Scene& scene, std::size_t link,
                  const Eigen::Isometry3d& X_FL, const ist::QueryConfig& config) {
  const Truth measured = truth_interval(scene.links[link], X_FL, scene.points);
  const Truth stored =
      truth_interval(scene.links[link], X_FL, ist::test::stored_points(scene.cloud.index));
  const Truth sampled = truth_interval(scene.links[link], X_FL, scene.samples);
  const double highest = std::min(stored.high, sampled.high);
  const double scale = 1.0 + X_FL.translation().norm();
  const double rounding = 4e-8 * scale;
  FUZZ_CHECK(answer.state != ist::LinkState::kUnknown, "unknown");
  FUZZ_CHECK(answer.lower_bound <= answer.distance, "bound %.12g above distance %.12g",
             answer.lower_bound, answer.distance);
  FUZZ_CHECK(answer.lower_bound <= std::min(measured.high, sampled.high) + rounding,
             "link %zu: bound %.12g, truth %.12g", link, answer.lower_bound,
             std::min(measured.high, sampled.high));
  if (answer.state == ist::LinkState::kClear) {
    FUZZ_CHECK(answer.lower_bound == config.max_distance - config.margin ||
                   answer.lower_bound == config.max_distance,
               "bound %.12g", answer.lower_bound);
    FUZZ_CHECK(answer.distance == kInf && highest > config.max_distance - rounding,
               "clear at %.12g", highest);
    return;
  }
  // In a map's box the depth is that of the deepest point found, 0 where none is (doc/sources.md).
  const bool in_box = answer.distance <= 0.0 && sampled.high < stored.high;
  FUZZ_CHECK(in_box || answer.distance <= highest + config.tolerance + rounding,
             "link %zu: distance %.12g, truth %.12g, tolerance %g", link, answer.distance, highest,
             config.tolerance);
  // Where none is found in a leaf, the leaf only just overlaps the link, if the link is convex.
  const bool is_convex = scene.links[link].size() == 1 &&
                         !std::holds_alternative<ist::TriangleMesh>(scene.links[link][0].shape);
  FUZZ_CHECK(!in_box || !is_convex || answer.distance < 0.0 || sampled.high > -1e-5 - rounding,
             "link %zu: distance %.12g, truth %.12g or deeper", link, answer.distance,
             sampled.high);
  if (scene.samples.empty()) {
    FUZZ_CHECK(answer.distance >= stored.low - 0.25 * config.tolerance - rounding,
               "link %zu: distance %.12g, truth %.12g", link, answer.distance, stored.low);
  }
  FUZZ_CHECK(answer.p_FCl.allFinite() && answer.p_FCo.allFinite(), "witness is not finite");
  FUZZ_CHECK(std::abs(answer.direction.norm() - 1.0) < 1e-9, "direction of length %g",
             answer.direction.norm());
  const double gap = (answer.p_FCl - answer.p_FCo - answer.distance * answer.direction).norm();
  FUZZ_CHECK(gap < 1e-9 * scale, "witnesses do not fit, %g m", gap);
  const Truth at_witness = truth_interval(scene.links[link], answer.p_LCl);
  FUZZ_CHECK(at_witness.low <= rounding, "witness is %g m off the link", at_witness.low);
  FUZZ_CHECK((answer.state == ist::LinkState::kContact) == (answer.distance < 0.0),
             "state %d at %g", static_cast<int>(answer.state), answer.distance);
}

void check_repulsion(const ist::Repulsion& repulsion, std::size_t link,
                     const Eigen::Isometry3d& X_FL, const Scene& scene,
                     const ist::LinkProximity& answer, const ist::RepulsionConfig& config) {
  const ist::RepulsiveWrench wrench = repulsion.wrench(
      link, X_FL, {scene.snapshots.data(), scene.snapshots.size()}, answer, config);
  FUZZ_CHECK(wrench.force.allFinite() && wrench.torque.allFinite(), "repulsion is not finite");
  FUZZ_CHECK(wrench.force.norm() <= config.gain * (1.0 + 1e-6), "repulsion %g, gain %g",
             wrench.force.norm(), config.gain);
  const double strength = ist::repulsion_strength(answer, config);
  FUZZ_CHECK(wrench.force.norm() <= config.gain * strength * (1.0 + 1e-6) + 1e-12,
             "repulsion %g, strength %g", wrench.force.norm(), strength);
}

// Points of either link bound the distance from above.
void check_pair(const ist::PairProximity& answer, const Scene& scene,
                const std::vector<Eigen::Isometry3d>& X_FL) {
  FUZZ_CHECK(answer.lower_bound <= answer.distance, "pair: bound %.12g, distance %.12g",
             answer.lower_bound, answer.distance);
  for (std::size_t a = 0; a < 2; ++a) {
    const std::size_t b = 1 - a;
    for (const ist::GeometryElement& element : scene.links[a]) {
      const auto* mesh = std::get_if<ist::TriangleMesh>(&element.shape);
      if (mesh == nullptr) continue;
      for (std::size_t t = 0; t < mesh->triangles.size(); ++t) {
        const Eigen::Vector3d middle =
            (mesh->corner(t, 0) + mesh->corner(t, 1) + mesh->corner(t, 2)) / 3.0;
        for (const Eigen::Vector3d& p : {mesh->corner(t, 0), middle}) {
          const Eigen::Vector3d p_B = X_FL[b].inverse() * (X_FL[a] * (element.X_LE * p));
          const double truth = truth_interval(scene.links[b], p_B).high;
          FUZZ_CHECK(answer.lower_bound <= truth + 1e-7, "pair: bound %.12g, a point at %.12g",
                     answer.lower_bound, truth);
        }
      }
    }
  }
}

ist::QueryConfig config_from(ByteReader* in) {
  constexpr double kTolerances[] = {0.0, 0.0, 1e-4, 0.001, 0.01};
  ist::QueryConfig config;
  config.tolerance = kTolerances[in->below(5)];
  config.max_distance = in->between(0.05, 3.0);
  return config;
}

Scene scene_from(ByteReader* in) {
  Scene scene;
  const auto* begin = reinterpret_cast<const char*>(in->rest());
  for (std::size_t i = 1 + in->below(2); i > 0; --i) scene.links.push_back(link_from(in));
  scene.key.assign(begin, reinterpret_cast<const char*>(in->rest()));
  const Eigen::Isometry3d X_FL = in->pose(1.0);
  for (const Eigen::Vector3d& p : points_from(in, scene.links[0])) scene.points.push_back(X_FL * p);
  scene.cloud = ist::test::make_snapshot(scene.points,
                                         in->flag() ? in->vector(1.0) : Eigen::Vector3d::Zero());
  std::vector<Eigen::AlignedBox3d> boxes;
  for (std::size_t i = in->byte() > 180 ? 1 + in->below(3) : 0; i > 0; --i) {
    const Eigen::Vector3d low = in->vector(0.8);
    const double side = ist::fuzz::length(in);
    boxes.emplace_back(low, low + Eigen::Vector3d::Constant(side));
  }
  if (!boxes.empty()) {
    scene.map = ist::test::make_map(boxes);
    scene.samples = samples_of(boxes);
  }
  return scene;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  Scene scene = scene_from(&in);
  scene.snapshots = {&scene.cloud};
  if (scene.map.boxes) scene.snapshots.push_back(&scene.map);
  for (const ist::LinkGeometry& link : scene.links) {
    for (const ist::GeometryElement& element : link) {
      const auto* mesh = std::get_if<ist::TriangleMesh>(&element.shape);
      if (mesh != nullptr && !(ist::fuzz::extent(*mesh) > 1e-5)) return 0;
    }
  }
  const auto model = model_of(scene.key, scene.links, &in);
  ist::ProximityQuery query(model, {});
  const ist::Repulsion repulsion(model);
  std::vector<ist::LinkProximity> answers;
  std::vector<Eigen::Isometry3d> X_FL(scene.links.size(), Eigen::Isometry3d::Identity());
  const std::vector<bool> known(scene.links.size(), true);
  const ist::SnapshotSpan clouds(scene.snapshots.data(), scene.snapshots.size());
  for (int step = 0; step < 4; ++step) {
    // A jump first, then motions that temporal coherence can follow.
    for (Eigen::Isometry3d& X : X_FL)
      X = X * (step == 0 ? in.pose(1.0) : in.pose(0.02 * (step - 1)));
    const ist::QueryConfig config = config_from(&in);
    query.set_config(config);
    FUZZ_CHECK(query.run(X_FL, known, clouds, &answers), "no deadline, and not complete");
    ist::RepulsionConfig pushing;
    pushing.influence_distance = config.max_distance;
    pushing.smoothing = in.between(0.0005, 0.3);
    for (std::size_t i = 0; i < answers.size(); ++i) {
      check_answer(answers[i], scene, i, X_FL[i], config);
      check_repulsion(repulsion, i, X_FL[i], scene, answers[i], pushing);
    }
  }
  if (scene.links.size() == 2) {
    ist::SelfQuery self(model, {{0, 1}}, query.config());
    std::vector<ist::PairProximity> pairs;
    self.run(X_FL, known, &pairs);
    if (pairs[0].state != ist::LinkState::kUnknown) check_pair(pairs[0], scene, X_FL);
  }
  return 0;
}
