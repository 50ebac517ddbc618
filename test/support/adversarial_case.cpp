#include "support/adversarial_case.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>
#include <variant>

#include "ist_proximity/proximity/self_query.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/truth_interval.h"

namespace ist::test {
namespace {

// A closed prism over a triangle, sheared: slivers where one length is far below another.
TriangleMesh prism(double a, double b, double c, const Eigen::Vector3d& shear) {
  const Eigen::Vector3d u(a, 0, 0), v(a * shear.x(), b, 0), w(a * shear.y(), b * shear.z(), c);
  const Eigen::Vector3d o = -(u + v + 1.5 * w) / 3.0;
  return {{o, o + u, o + v, o + w, o + u + w, o + v + w},
          {{0, 2, 1}, {3, 4, 5}, {0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}, {2, 0, 3}, {2, 3, 5}}};
}

// [m] One rounding of float (2^-24) of the lengths involved: it decides on which side of a surface
// a point lies.
double adversarial_rounding(const TriangleMesh& mesh, const Eigen::Isometry3d& X_FL) {
  double radius = 0.0;
  for (const Eigen::Vector3d& v : mesh.vertices) radius = std::max(radius, v.norm());
  return std::ldexp(1.0, -24) * (1.0 + radius + X_FL.translation().norm());
}

void judge_answer(const AdversarialCase& c, const LinkProximity& answer, std::size_t step,
                  Violations* worst) {
  const QueryConfig& config = c.configs[step];
  const Eigen::Isometry3d& X_FL = c.X_FL[step];
  const TruthInterval measured = truth_interval(c.link, X_FL, c.points_F);
  const TruthInterval stored = truth_interval(c.link, X_FL, stored_points(c.cloud.index));
  const double rounding = adversarial_rounding(std::get<TriangleMesh>(c.link[0].shape), X_FL);
  worst->add(0, answer.lower_bound - measured.high - rounding);
  if (answer.state == LinkState::kUnknown) worst->add(4, 1.0);
  if (answer.state == LinkState::kClear) {
    worst->add(4, config.max_distance - stored.high - rounding);
    return;
  }
  // The distance is that of a point, to within a quarter of the tolerance.
  const double error = std::max(answer.distance - config.tolerance - stored.high,
                                stored.low - 0.25 * config.tolerance - answer.distance) -
                       rounding;
  worst->add(stored.high < 0.0 ? 3 : 1, error);
  const double extent = X_FL.translation().norm() + std::abs(stored.high) + 10.0;
  worst->add(2, answer.distance - answer.lower_bound - config.tolerance - 2e-7 * extent);
  const bool certain = stored.low > rounding || stored.high < -rounding;
  if (certain && (answer.state == LinkState::kContact) != (stored.high < 0.0)) {
    worst->add(4, std::abs(stored.high));
  }
}

// Points of the first link's surface bound the distance of the pair from above.
void judge_pair(const AdversarialCase& c, const PairProximity& answer, Violations* worst) {
  const auto& mesh = std::get<TriangleMesh>(c.link[0].shape);
  const LinkGeometry other = {
      {Box{{0.3, 0.2, 0.1}}, Eigen::Isometry3d::Identity(), "the same box, exactly"}};
  const Eigen::Isometry3d X_BL = c.X_LB.inverse();
  double sampled = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int i = 0; i <= 4; ++i) {
      for (int k = 0; i + k <= 4; ++k) {
        const Eigen::Vector3d p = 0.25 * ((4 - i - k) * mesh.corner(t, 0) + i * mesh.corner(t, 1) +
                                          k * mesh.corner(t, 2));
        sampled = std::min(sampled, truth_interval(other, X_BL * p).high);
      }
    }
  }
  worst->add(5, answer.lower_bound - sampled - 1e-7);
  // With holes the bound may be far below: a point outside may be next to one.
  const bool closed = c.model->links[0].solid.is_closed();
  if (closed && answer.state == LinkState::kNear && answer.distance > 0.0) {
    double allowed = 0.0;
    for (const LinkModel& link : c.model->links) {
      allowed = std::max(allowed, link.packing.certificate.max_gap);
    }
    for (const LinkModel& link : c.model->links) allowed += link.packing.certificate.interior_gap;
    worst->add(5, answer.distance - answer.lower_bound - allowed - c.configs[0].tolerance - 1e-6);
  }
}

}  // namespace

std::string to_text(const Genome& genome) {
  std::string text;
  for (const std::uint16_t gene : genome) {
    char digits[5];
    std::snprintf(digits, sizeof digits, "%04x", gene);
    text += digits;
  }
  return text;
}

Genome genome_from(const std::string& text) {
  Genome genome;
  for (std::size_t i = 0; i + 4 <= text.size(); i += 4) {
    genome.push_back(static_cast<std::uint16_t>(std::stoul(text.substr(i, 4), nullptr, 16)));
  }
  return genome;
}

GeneReader::GeneReader(const Genome& genome, std::size_t first) : genome_(genome), next_(first) {}

double GeneReader::fraction() {
  const std::size_t i = next_++;
  return i < genome_.size() ? genome_[i] / 65535.0 : 0.0;
}

std::size_t GeneReader::below(std::size_t n) {
  return std::min(n - 1, static_cast<std::size_t>(fraction() * static_cast<double>(n)));
}

double GeneReader::decades(double low, double high) { return std::pow(10.0, between(low, high)); }

Eigen::Vector3d GeneReader::vector(double size) {
  const double x = between(-size, size), y = between(-size, size), z = between(-size, size);
  return {x, y, z};
}

Eigen::Isometry3d GeneReader::pose(double angle, double size) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d turn = vector(angle);
  X.translation() = vector(size);
  if (turn.norm() > 0.0) {
    X.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  return X;
}

TriangleMesh mesh_of(const Genome& genome) {
  GeneReader genes(genome);
  const std::size_t kind = genes.below(9);
  const double a = genes.decades(-2.0, 0.0), b = genes.decades(-5.0, 0.0),
               c = genes.decades(-5.0, 0.0);
  const Eigen::Vector3d shear = genes.vector(1.0);
  const double cut = genes.fraction(), bulge = genes.fraction();
  const int count = 1 + static_cast<int>(genes.below(12));
  TriangleMesh mesh;
  switch (kind) {
    case 0:
      mesh = prism(a, b, c, shear);
      break;
    case 1:
      mesh = box({a, b, c});
      break;
    case 2:
      mesh = open_box({a, b, c});
      break;
    case 3:
      mesh = sliver_plate(a, b, c, count);
      break;
    case 4:
      mesh = needle(a, b);
      break;
    case 5:
      mesh = l_shape(a, std::min(b, 0.9 * a));
      break;
    case 6:
      mesh = torus(a, std::min(b, 0.9 * a), 3 + count, 3 + count / 2);
      break;
    default:
      mesh = icosphere(0.5 * a, kind == 7 ? 0 : 1);
  }
  if (kind >= 7) {  // a shell: squeezed, dented, and with a hole
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      Eigen::Vector3d& v = mesh.vertices[i];
      v = v.cwiseProduct(Eigen::Vector3d(1.0, b, c).cwiseMax(1e-3));
      if (i % 3 == 0) v *= 1.0 - 0.8 * bulge;
    }
    mesh.triangles.resize(mesh.triangles.size() -
                          static_cast<std::size_t>(0.6 * std::max(0.0, cut - 0.3) *
                                                   static_cast<double>(mesh.triangles.size())));
  }
  return moved(mesh, genes.pose(2.0, 1.0));
}

std::shared_ptr<const RobotModel> adversarial_model(const Genome& genome) {
  GeneReader genes(genome, kMeshGenes - 2);
  RobotModelConfig config;
  config.packing.max_error = genes.decades(-3.0, -1.5);
  config.packing.max_spheres = static_cast<int>(genes.decades(0.0, 2.5));
  config.threads = 1;
  RobotDescription description;
  description.links.resize(2);
  description.links[0].name = "adversary";
  description.links[0].geometry = {{mesh_of(genome), Eigen::Isometry3d::Identity(), "genome"}};
  description.links[1].name = "box";
  description.links[1].geometry = {
      {box({0.3, 0.2, 0.1}), Eigen::Isometry3d::Identity(), "a box for the self-query"}};
  return build_robot_model(description, config);
}

Violations::Violations() { excess.fill(-std::numeric_limits<double>::infinity()); }

void Violations::add(std::size_t promise, double value) {
  excess[promise] = std::max(excess[promise], std::isnan(value) ? 1e9 : value);
}

AdversarialCase::AdversarialCase(const Genome& genome, std::shared_ptr<const RobotModel> packed) {
  const TriangleMesh mesh = mesh_of(genome);
  link = {{mesh, Eigen::Isometry3d::Identity(), "genome"}};
  model = packed ? std::move(packed) : adversarial_model(genome);
  GeneReader genes(genome, kMeshGenes);
  Eigen::Isometry3d X = genes.pose(2.0, 2.0);
  for (int step = 0; step < kSteps; ++step) {
    X_FL.push_back(X);
    const double size = genes.decades(-9.0, -0.3);
    X = X * genes.pose(2.0 * size, size);
    constexpr double kTolerances[] = {0.0, 1e-4, 1e-3};
    QueryConfig config;
    config.tolerance = kTolerances[genes.below(3)];
    config.max_distance = genes.decades(-1.0, 0.5);
    configs.push_back(config);
  }
  X_LB = genes.pose(2.0, 0.6);
  repulsion.influence_distance = genes.decades(-1.0, 0.0);
  repulsion.smoothing = genes.decades(-3.0, 0.0);
  const Eigen::Vector3d origin = genes.vector(1.5);
  const std::size_t count = 1 + genes.below(10);
  for (std::size_t i = 0; i < count; ++i) points_F.push_back(X_FL[0] * point(mesh, &genes));
  cloud = make_snapshot(points_F, origin);
}

Eigen::Vector3d AdversarialCase::point(const TriangleMesh& mesh, GeneReader* genes) {
  const std::size_t t = genes->below(mesh.triangles.size());
  const double a = genes->between(0.0, 1.0), b = genes->between(0.0, 1.0 - a);
  const double off = genes->decades(-9.0, -0.3);
  return (1.0 - a - b) * mesh.corner(t, 0) + a * mesh.corner(t, 1) + b * mesh.corner(t, 2) +
         genes->vector(off);
}

Violations judge(const AdversarialCase& c) {
  Violations worst;
  ProximityQuery query(c.model, {});
  const Repulsion repulsion(c.model);
  std::vector<LinkProximity> answers;
  for (std::size_t step = 0; step < c.X_FL.size(); ++step) {
    const std::vector<Eigen::Isometry3d> X_FL = {c.X_FL[step], c.X_FL[step]};
    query.set_config(c.configs[step]);
    query.run(X_FL, {true, false}, {&c.cloud}, &answers);
    judge_answer(c, answers[0], step, &worst);
    RepulsionConfig config = c.repulsion;
    config.influence_distance = std::min(config.influence_distance, c.configs[step].max_distance);
    const RepulsiveWrench wrench = repulsion.wrench(0, X_FL[0], {&c.cloud}, answers[0], config);
    worst.add(6, wrench.force.norm() -
                     config.gain * repulsion_strength(answers[0], config) * (1.0 + 1e-6));
  }
  SelfQuery self(c.model, {{0, 1}}, c.configs[0]);
  std::vector<PairProximity> pairs;
  self.run(std::vector<Eigen::Isometry3d>{c.X_FL[0], c.X_FL[0] * c.X_LB}, {true, true}, &pairs);
  judge_pair(c, pairs[0], &worst);
  return worst;
}

}  // namespace ist::test
