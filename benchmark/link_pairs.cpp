// Link against link beside FCL: the Panda's visual and collision meshes and the demo arm. Random
// configurations, and a motion at 1 kHz; and a check by brute force. With a document, writes
// its tables there.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Usage: link_pairs [DOCUMENT]
// [configurations] [all | time | accuracy] [robot]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "link_pairs/fcl.h"
#include "link_pairs/robot.h"
#include "support.h"
#include "support/demo_arm.h"
#include "support/link_pair_oracle.h"
#include "support/scene.h"

namespace {

using ist::LinkPair;
using ist::LinkState;
using ist::PairProximity;
using ist::benchmark::make_robot;
using ist::benchmark::panda;
using ist::benchmark::quantile;
using ist::benchmark::Robot;

constexpr unsigned kMotion = 1;  // seed of the motion that is timed

std::string ratio(double peer, double ours) {
  char text[64] = "-";
  if (peer > 0.0) std::snprintf(text, sizeof text, "%.*f", peer < 10.0 * ours ? 1 : 0, peer / ours);
  return text;
}

// Times and answers of FCL.
struct Measured {
  std::vector<double> us;
  std::vector<double> distances;  // [m] by pair, of the last run
  int wrong = 0;

  // Compares with the exact distances where links are apart.
  void compare(const std::vector<PairProximity>& exact) {
    constexpr double kFloat = 2e-5;  // [m]
    for (std::size_t k = 0; k < exact.size(); ++k) {
      if (exact[k].state != LinkState::kNear) continue;
      wrong += std::abs(distances[k] - exact[k].distance) > kFloat ? 1 : 0;
    }
  }
};

// The next configuration of a motion towards another one, each joint at up to 0.5 rad/s.
void step_towards(const std::vector<double>& to, std::vector<double>* q) {
  for (std::size_t j = 0; j < q->size(); ++j) (*q)[j] += 5e-4 * std::tanh(4.0 * (to[j] - (*q)[j]));
}

// Times of all pairs: ours to 1 mm and exact, and the peers', in the same run.
// @param seed    of the configurations, or of the motion
void measure_time(const Robot& robot, bool is_motion, unsigned seed, int count, std::string* rows) {
  ist::test::Rng rng(seed);
  ist::ForwardKinematics forward(*robot.model, robot.kinematics);
  std::vector<PairProximity> results;
  std::vector<double> ours[2], searched, steps;
  std::vector<std::unique_ptr<ist::SelfQuery>> queries;
  for (const double tolerance : {0.001, 0.0}) {
    ist::QueryConfig config;
    config.max_distance = 10.0;
    config.tolerance = tolerance;
    queries.push_back(std::make_unique<ist::SelfQuery>(robot.model, robot.pairs, config));
  }
  std::function<double(const LinkPair&, const std::vector<Eigen::Isometry3d>&)> fcl;
#ifdef IST_PROXIMITY_HAS_FCL
  if (robot.is_meshes) fcl = ist::benchmark::fcl_distances(robot);  // else it has other shapes
#endif
  Measured measured;
  ist::benchmark::ThreadTimer timer;
  std::vector<double> q = robot.random_position(&rng), to = robot.random_position(&rng);
  for (int i = 0; i < count; ++i) {
    if (is_motion) {
      step_towards(to, &q);
    } else {
      q = robot.random_position(&rng);
    }
    const ist::LinkPoses& poses = forward.run(q);
    for (std::size_t k = 0; k < 2; ++k) {
      timer.lap();
      queries[k]->run(poses.X_FL, poses.known, &results);
      ours[k].push_back(timer.lap());
      if (k > 0) continue;
      searched.push_back(100.0 * static_cast<double>(queries[k]->statistics().pairs_searched) /
                         static_cast<double>(robot.pairs.size()));
      steps.push_back(static_cast<double>(queries[k]->statistics().steps));
    }
    if (!fcl || (is_motion && i % 100 > 0)) continue;
    measured.distances.clear();
    timer.lap();
    for (const LinkPair& pair : robot.pairs) measured.distances.push_back(fcl(pair, poses.X_FL));
    measured.us.push_back(timer.lap());
    measured.compare(results);
  }
  char name[160], row[400];
  if (is_motion) {
    std::snprintf(name, sizeof name, "1 kHz motion");
  } else {
    std::snprintf(name, sizeof name, "%d random", count);
  }
  const double to_1_mm = quantile(ours[0], 0.5), exact = quantile(ours[1], 0.5);
  const double of_peer = quantile(measured.us, 0.5);
  std::snprintf(row, sizeof row,
                "| %s | %s | %.0f / %.0f | %.0f | %.0f | %.0f | %.0f | %s | %s | %d |\n",
                robot.name.c_str(), name, to_1_mm, quantile(ours[0], 0.99), exact,
                ist::benchmark::mean(searched), ist::benchmark::mean(steps), of_peer,
                ratio(of_peer, to_1_mm).c_str(), ratio(of_peer, exact).c_str(), measured.wrong);
  *rows += row;
  std::printf("%s", row);
  std::fflush(stdout);
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
std::string measure_accuracy(const Robot& robot, int configurations) {
  const std::vector<double> tolerances = {0.0, 0.001};
  std::vector<ist::test::TriangleGroups> groups;
  for (const auto& triangles : robot.triangles) groups.emplace_back(triangles);
  std::vector<ist::SelfQuery> queries;
  for (const double tolerance : tolerances) {
    ist::QueryConfig config;
    config.max_distance = 10.0;
    config.tolerance = tolerance;
    queries.emplace_back(robot.model, robot.pairs, config);
  }
  std::vector<Accuracy> found(tolerances.size());
  std::vector<std::vector<PairProximity>> results(tolerances.size());
  const auto is_closed = [&](std::size_t link) {
    return robot.model->links[link].solid.is_closed();
  };
  int closed = 0;
  ist::test::Rng rng(8);
  ist::ForwardKinematics forward(*robot.model, robot.kinematics);
  for (int i = 0; i < configurations; ++i) {
    const ist::LinkPoses& poses = forward.run(robot.random_position(&rng));
    for (std::size_t t = 0; t < tolerances.size(); ++t) {
      queries[t].run(poses.X_FL, poses.known, &results[t]);
    }
    for (std::size_t k = 0; k < robot.pairs.size(); ++k) {
      const auto [a, b] = robot.pairs[k];
      const Eigen::Isometry3d X_AB = poses.X_FL[a].inverse() * poses.X_FL[b];
      const double truth = groups[a].distance(groups[b], X_AB);
      const double inexactness = robot.inexactness[a] + robot.inexactness[b];
      const bool is_decided = truth == 0.0 || truth > inexactness;
      const bool has_contact_truth = is_closed(a) && is_closed(b) && is_decided;
      closed += has_contact_truth ? 1 : 0;
      const bool touch =
          has_contact_truth && (truth == 0.0 || groups[a].holds_part_of(groups[b], X_AB) ||
                                groups[b].holds_part_of(groups[a], X_AB.inverse()));
      for (std::size_t t = 0; t < tolerances.size(); ++t) {
        const PairProximity& r = results[t][k];
        found[t].check(r, truth, inexactness, tolerances[t]);
        found[t].wrong_contacts +=
            has_contact_truth && touch != (r.state == LinkState::kContact) ? 1 : 0;
      }
    }
    if (i % 100 == 99) {
      std::fprintf(stderr, "%s: %d configurations\n", robot.name.c_str(), i + 1);
    }
  }
  std::string rows;
  for (std::size_t t = 0; t < tolerances.size(); ++t) {
    const Accuracy& one = found[t];
    char row[256];
    std::snprintf(
        row, sizeof row, "| %s | %g | %d | %d | %d | %d | %d | %.2g | %.2g | %d of %d |\n",
        robot.name.c_str(), 1e3 * tolerances[t], one.near, one.contacts, one.violations,
        one.in_doubt, one.wide, 1e3 * one.widest, 1e3 * one.largest, one.wrong_contacts, closed);
    rows += row;
    std::printf("%s", row);
    std::fflush(stdout);
  }
  return rows;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string document = argc > 1 ? argv[1] : "";
  const int configurations = argc > 2 ? std::atoi(argv[2]) : 2000;
  const std::string part = argc > 3 ? argv[3] : "all";
  const std::string only = argc > 4 ? argv[4] : "";
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  std::vector<Robot> robots;
  const auto add = [&](const std::string& name, const std::function<Robot(std::string)>& make) {
    if (name.find(only) != std::string::npos) robots.push_back(make(name));
  };
  add("Panda, visual meshes",
      [&](std::string name) { return panda(data, ist::GeometrySource::kVisual, std::move(name)); });
  add("Panda, collision meshes", [&](std::string name) {
    return panda(data, ist::GeometrySource::kCollision, std::move(name));
  });
  add("demo arm",
      [](std::string name) { return make_robot(std::move(name), ist::test::demo_robot()); });
  const auto write = [&](const char* name, const std::string& table) {
    return document.empty() || ist::benchmark::write_table(document, name, table);
  };
  bool written = true;
  if (part == "all" || part == "time") {
    std::string time =
        "| robot | poses | to 1 mm, median / p99 [us] | exact, median [us] | pairs looked at [%] | "
        "steps | FCL, exact [us] | FCL / to 1 mm | FCL / exact | FCL's wrong answers |\n"
        "|---|---|---|---|---|---|---|---|---|---|\n";
    for (const Robot& robot : robots) {
      measure_time(robot, false, 7, std::min(configurations, 200), &time);
      measure_time(robot, true, kMotion, 1000, &time);
    }
    written = write("link pairs", time);
  }
  if (part == "all" || part == "accuracy") {
    std::string accuracy =
        "| robot | tolerance [mm] | near | contacts | violations | in doubt | wider than the "
        "tolerance | widest [mm] | largest error [mm] | contact told wrong, of closed pairs |\n"
        "|---|---|---|---|---|---|---|---|---|---|\n";
    for (const Robot& robot : robots) accuracy += measure_accuracy(robot, configurations);
    written = write("link pair accuracy", accuracy) && written;
  }
  return written ? 0 : 1;
}
