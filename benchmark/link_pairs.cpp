// Link against link beside FCL: the Panda's visual and collision meshes and the demo arm. Random
// configurations, and a motion at 1 kHz; and a check by brute force.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "fcl_geometry.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support.h"
#include "support/demo_arm.h"
#include "support/link_pair_oracle.h"
#include "support/scene.h"
#include "support/truth.h"

namespace {

using ist::LinkPair;
using ist::LinkState;
using ist::PairProximity;
using ist::benchmark::quantile;
using ist::benchmark::text_of;

constexpr std::array kTolerances = {0.001, 0.0};  // [m]

// A robot whose links are measured against one another.
struct Robot {
  std::string name;
  std::shared_ptr<const ist::RobotModel> model;
  std::shared_ptr<const ist::Kinematics> kinematics;
  std::vector<LinkPair> pairs;
  std::vector<std::vector<ist::test::Corners3<double>>> triangles;  // by link
  // [m] By link: the triangles of its cylinders and spheres are at most this far inside them.
  std::vector<double> inexactness;
  bool is_meshes = true;  // no cylinders and spheres, which FCL would measure as triangles

  // All pairs, at a tolerance [m].
  ist::SelfQuery query(double tolerance) const {
    ist::QueryConfig config;
    config.max_distance = 10.0;
    config.tolerance = tolerance;
    return {model, pairs, config};
  }

  std::vector<double> random_position(ist::test::Rng* rng) const {
    std::vector<double> q;
    for (const auto& joint : kinematics->joints()) {
      const double low = std::max(joint.lower, -3.1), high = std::min(joint.upper, 3.1);
      q.push_back(joint.is_free() ? ist::test::uniform(rng, low, high) : 0.0);
    }
    return q;
  }
};

Robot make_robot(const std::string& name, const ist::RobotDescription& description) {
  Robot robot;
  robot.name = name;
  ist::RobotModelConfig config;
  config.packing.max_error = 0.01;
  robot.model = ist::build_robot_model(description, config);
  robot.kinematics = std::make_shared<const ist::Kinematics>(description);
  const std::vector<bool> all(robot.model->links.size(), true);
  robot.pairs = ist::self_collision_pairs(*robot.model, *robot.kinematics, all, {});
  for (const ist::LinkModel& link : robot.model->links) {
    for (const ist::LinkDescription& one : description.links) {
      if (one.name != link.name) continue;
      robot.triangles.push_back(ist::test::triangles_of(one.geometry));
      robot.inexactness.push_back(
          ist::test::append_round_shapes(one.geometry, &robot.triangles.back()));
      for (const ist::GeometryElement& element : one.geometry) {
        robot.is_meshes = robot.is_meshes &&
                          !std::holds_alternative<ist::Cylinder>(element.shape) &&
                          !std::holds_alternative<ist::Sphere>(element.shape);
      }
    }
  }
  return robot;
}

// FCL: the distances [m] of all pairs, which it begins anew each time.
class Fcl {
 public:
  explicit Fcl(const Robot& robot) : pairs_(robot.pairs) {
    for (const auto& triangles : robot.triangles) {
      std::vector<Eigen::Vector3d> vertices;
      std::vector<fcl::Triangle> faces;
      for (const auto& t : triangles) {
        const std::size_t first = vertices.size();
        vertices.insert(vertices.end(), t.p, t.p + 3);
        faces.emplace_back(first, first + 1, first + 2);
      }
      models_.push_back(ist::benchmark::fcl_mesh(vertices, faces));
    }
  }

  void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) const {
    distances->clear();
    for (const auto& [a, b] : pairs_) {
      fcl::DistanceRequestd request;
      request.enable_nearest_points = true;
      fcl::DistanceResultd result;
      distances->push_back(
          fcl::distance(models_[a].get(), X_FL[a], models_[b].get(), X_FL[b], request, result));
    }
  }

 private:
  std::vector<LinkPair> pairs_;
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> models_;
};

// The next configuration of a motion towards another one, each joint at up to 0.5 rad/s.
void step_towards(const std::vector<double>& to, std::vector<double>* q) {
  for (std::size_t j = 0; j < q->size(); ++j) (*q)[j] += 5e-4 * std::tanh(4.0 * (to[j] - (*q)[j]));
}

// The answers of FCL that differ from the exact ones where links are apart.
int count_wrong(const std::vector<double>& distances, const std::vector<PairProximity>& exact) {
  constexpr double kFloat = 2e-5;  // [m]
  int wrong = 0;
  for (std::size_t k = 0; k < distances.size(); ++k) {
    if (exact[k].state != LinkState::kNear) continue;
    wrong += std::abs(distances[k] - exact[k].distance) > kFloat ? 1 : 0;
  }
  return wrong;
}

std::string ratio(double peer, double ours) {
  return text_of("%.*f", peer < 10.0 * ours ? 1 : 0, peer / ours);
}

// Times of all pairs: ours to 1 mm and exact, and FCL's, in the same run.
std::string time_row(const Robot& robot, bool is_motion, unsigned seed, int count) {
  ist::test::Rng rng(seed);
  ist::ForwardKinematics forward(*robot.model, robot.kinematics);
  std::vector<PairProximity> results;
  std::array<std::vector<double>, kTolerances.size()> ours;
  std::vector<double> searched, steps, peer, distances;
  std::vector<ist::SelfQuery> queries;
  for (const double tolerance : kTolerances) queries.push_back(robot.query(tolerance));
  const Fcl fcl(robot);
  int wrong = 0;
  ist::benchmark::ThreadTimer timer;
  std::vector<double> q = robot.random_position(&rng), to = robot.random_position(&rng);
  for (int i = 0; i < count; ++i) {
    if (is_motion) {
      step_towards(to, &q);
    } else {
      q = robot.random_position(&rng);
    }
    const ist::LinkPoses& poses = forward.run(q);
    for (std::size_t k = 0; k < queries.size(); ++k) {
      timer.lap();
      queries[k].run(poses.X_FL, poses.known, &results);
      ours[k].push_back(timer.lap());
    }
    searched.push_back(100.0 * static_cast<double>(queries[0].statistics().pairs_searched) /
                       static_cast<double>(robot.pairs.size()));
    steps.push_back(static_cast<double>(queries[0].statistics().steps));
    // Round shapes are other ones for FCL.
    if (!robot.is_meshes || (is_motion && i % 100 > 0)) continue;
    timer.lap();
    fcl.run(poses.X_FL, &distances);
    peer.push_back(timer.lap());
    wrong += count_wrong(distances, results);
  }
  const double to_1_mm = quantile(ours[0], 0.5), exact = quantile(ours[1], 0.5);
  const double of_peer = quantile(peer, 0.5);
  const std::string beside =
      peer.empty() ? " |  |  | "
                   : text_of("%.0f | %s | %s | %d", of_peer, ratio(of_peer, to_1_mm).c_str(),
                             ratio(of_peer, exact).c_str(), wrong);
  return text_of("| %s | %s | %.0f / %.0f | %.0f | %.0f | %.0f | %s |\n", robot.name.c_str(),
                 is_motion ? "1 kHz motion" : text_of("%d random", count).c_str(), to_1_mm,
                 quantile(ours[0], 0.99), exact, ist::benchmark::mean(searched),
                 ist::benchmark::mean(steps), beside.c_str());
}

// How the answers at one tolerance compare with brute force.
struct Accuracy {
  int near = 0, contacts = 0, violations = 0, in_doubt = 0, wide = 0, wrong_contacts = 0;
  double widest = 0.0, largest = 0.0;  // [m]

  // @param inexactness  [m] the truth is at most this much smaller than `truth`
  void check(const PairProximity& r, double truth, double inexactness, double tolerance) {
    contacts += r.state == LinkState::kContact ? 1 : 0;
    if (r.state != LinkState::kNear) return;
    ++near;
    violations += r.lower_bound > truth + 1e-13 || r.distance < truth - inexactness - 1e-13 ||
                          (truth == 0.0 && r.distance > 0.0)
                      ? 1
                      : 0;
    in_doubt += r.lower_bound <= 0.0 ? 1 : 0;
    if (r.lower_bound <= 0.0) return;
    wide += r.distance - r.lower_bound > tolerance + 1e-5 ? 1 : 0;
    widest = std::max(widest, r.distance - r.lower_bound);
    largest = std::max(largest, r.distance - truth);
  }
};

// Answers beside brute force, at each tolerance the same configurations.
class AccuracyTrial {
 public:
  explicit AccuracyTrial(const Robot& robot)
      : robot_(robot), forward_(*robot.model, robot.kinematics) {
    for (const auto& triangles : robot.triangles) groups_.emplace_back(triangles);
    for (const double tolerance : kTolerances) queries_.push_back(robot.query(tolerance));
  }

  void run(const std::vector<double>& q) {
    const ist::LinkPoses& poses = forward_.run(q);
    for (std::size_t t = 0; t < kTolerances.size(); ++t) {
      queries_[t].run(poses.X_FL, poses.known, &results_[t]);
    }
    for (std::size_t k = 0; k < robot_.pairs.size(); ++k) check_pair(k, poses);
  }

  std::string rows() const {
    std::string text;
    for (std::size_t i = 0; i < kTolerances.size(); ++i) {
      const std::size_t t = kTolerances.size() - 1 - i;  // the exact one first
      const Accuracy& one = found_[t];
      text += text_of("| %s | %g | %d | %d | %d | %d | %d | %.2g | %.2g | %d of %d |\n",
                      robot_.name.c_str(), 1e3 * kTolerances[t], one.near, one.contacts,
                      one.violations, one.in_doubt, one.wide, 1e3 * one.widest, 1e3 * one.largest,
                      one.wrong_contacts, closed_);
    }
    return text;
  }

 private:
  bool is_closed(std::size_t link) const { return robot_.model->links[link].solid.is_closed(); }

  void check_pair(std::size_t k, const ist::LinkPoses& poses) {
    const auto [a, b] = robot_.pairs[k];
    const Eigen::Isometry3d X_AB = poses.X_FL[a].inverse() * poses.X_FL[b];
    const double truth = groups_[a].distance(groups_[b], X_AB);
    const double inexactness = robot_.inexactness[a] + robot_.inexactness[b];
    const bool is_decided = truth == 0.0 || truth > inexactness;
    const bool has_contact_truth = is_closed(a) && is_closed(b) && is_decided;
    closed_ += has_contact_truth ? 1 : 0;
    const bool touch =
        has_contact_truth && (truth == 0.0 || groups_[a].holds_part_of(groups_[b], X_AB) ||
                              groups_[b].holds_part_of(groups_[a], X_AB.inverse()));
    for (std::size_t t = 0; t < kTolerances.size(); ++t) {
      const PairProximity& r = results_[t][k];
      found_[t].check(r, truth, inexactness, kTolerances[t]);
      const bool is_wrong = has_contact_truth && touch != (r.state == LinkState::kContact);
      found_[t].wrong_contacts += is_wrong ? 1 : 0;
    }
  }

  const Robot& robot_;
  ist::ForwardKinematics forward_;
  std::vector<ist::test::TriangleGroups> groups_;
  std::vector<ist::SelfQuery> queries_;
  std::array<std::vector<PairProximity>, kTolerances.size()> results_;
  std::array<Accuracy, kTolerances.size()> found_;
  int closed_ = 0;  // pairs of closed links whose contact is certain
};

}  // namespace

int main(int argc, char** argv) {
  int configurations = 2000;
  ist::benchmark::CommandLine line("Link against link, beside FCL and brute force.");
  line.add_option("--configurations", configurations, "Checked by brute force");
  line.read(argc, argv);
  const auto data = ist::benchmark::data_or_exit();
  const auto panda = [&](ist::GeometrySource source) {
    return ist::test::read_panda(data, source);
  };
  const std::vector<Robot> robots = {
      make_robot("Panda, visual meshes", panda(ist::GeometrySource::kVisual)),
      make_robot("Panda, collision meshes", panda(ist::GeometrySource::kCollision)),
      make_robot("demo arm", ist::test::demo_robot())};
  std::string times =
      "| robot | poses | to 1 mm, median / p99 [us] | exact, median [us] | pairs looked at [%] | "
      "steps | FCL, exact [us] | FCL / to 1 mm | FCL / exact | FCL's wrong answers |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  std::string accuracy =
      "| robot | tolerance [mm] | near | contacts | violations | in doubt | wider than the "
      "tolerance | widest [mm] | largest error [mm] | contact told wrong, of closed pairs |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Robot& robot : robots) {
    times += time_row(robot, false, 7, 100) + time_row(robot, true, 1, 1000);
  }
  const int failed = line.publish("link pairs", times);
  for (const Robot& robot : robots) {
    std::fprintf(stderr, "%s: brute force\n", robot.name.c_str());
    AccuracyTrial trial(robot);
    ist::test::Rng rng(8);
    for (int i = 0; i < configurations; ++i) trial.run(robot.random_position(&rng));
    accuracy += trial.rows();
  }
  return line.publish("link pair accuracy", accuracy) + failed;
}
