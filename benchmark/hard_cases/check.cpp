#include "hard_cases/check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "internal/geometry/tessellation.h"
#include "support/shape_oracle.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kLikely = 24, kRandom = 8;  // points of a link that brute force measures
constexpr std::size_t kMeasured = 5000;           // points among which the likely ones are chosen
constexpr double kRounding = 2e-8;                // [m] of double precision
constexpr double kStored = 2e-6;                  // [m] of a cloud's float coordinates

// The points in the link's frame that can be at most `range` [m] from the link.
std::vector<Eigen::Vector3d> points_in_range(const Frame& frame, const LinkGeometry& link,
                                             const Eigen::Isometry3d& X_FL, double range) {
  Eigen::AlignedBox3d box;
  for (const GeometryElement& element : link) {
    const TriangleMesh mesh = mesh_of(element.shape, 1e-4);
    for (const Eigen::Vector3d& v : mesh.vertices) box.extend(element.X_LE * v);
  }
  const Eigen::Isometry3d X_LS = X_FL.inverse() * frame.X_FS;
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const Eigen::Vector3d p_L = X_LS * frame.point(i).cast<double>();
    if (p_L.allFinite() && box.exteriorDistance(p_L) <= range) points.push_back(p_L);
  }
  return points;
}

// Brute force over likely and random points: an upper bound of the truth, which is nearly always
// the truth.
double least_distance(std::vector<Eigen::Vector3d> points_L, const LinkGeometry& link,
                      const Solid& solid, std::mt19937_64* rng) {
  std::shuffle(points_L.begin(), points_L.end(), *rng);
  points_L.resize(std::min(points_L.size(), kMeasured));
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < points_L.size(); ++i) {
    order.emplace_back(solid.signed_distance(points_L[i]).distance, i);
  }
  const std::size_t likely = std::min(kLikely, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(likely),
                    order.end());
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < std::min(kLikely + kRandom, order.size()); ++k) {
    least = std::min(least, test::oracle_signed_distance(link, points_L[order[k].second]));
  }
  return least;
}

}  // namespace

void check_answers(const HardScene& scene, const RobotModel& model, const Frame& frame,
                   const Poses& X_FL, const QueryConfig& config,
                   const std::vector<LinkProximity>& answers, std::mt19937_64* rng,
                   Checked* checked) {
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const LinkProximity& answer = answers[i];
    const LinkGeometry& link = scene.robot.links[i].geometry;
    const bool is_clear = answer.state == LinkState::kClear;
    const double range = is_clear ? config.max_distance : std::max(0.0, answer.distance);
    double truth = least_distance(points_in_range(frame, link, X_FL[i], range), link,
                                  model.links[i].solid, rng);
    bool holds = answer.state != LinkState::kUnknown;
    if (holds && !is_clear) {
      const Eigen::Vector3d p_F = frame.X_FS * frame.point(answer.point).cast<double>();
      const double named = test::oracle_signed_distance(link, X_FL[i].inverse() * p_F);
      truth = std::min(truth, named);
      const double width = answer.distance - answer.lower_bound;
      checked->largest_width = std::max(checked->largest_width, width);
      holds = std::abs(named - answer.distance) <= 0.25 * config.tolerance + kStored &&
              width <= config.tolerance + kStored;
    }
    holds = holds && answer.lower_bound <= truth + kRounding;
    ++checked->answers;
    if (!holds && checked->wrong++ == 0) {
      std::fprintf(stderr, "%s, %s, link %zu: [%.9f, %.9f] m, truth at most %.9f m\n",
                   scene.name.c_str(), scene.link.c_str(), i, answer.lower_bound, answer.distance,
                   truth);
    }
  }
}

}  // namespace ist::benchmark
