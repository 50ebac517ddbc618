// Trajectories of a robot among obstacles.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "internal/geometry/numbers.h"
#include "internal/robot/threads.h"
#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/facade/robot.h"
#include "ist_proximity/proximity/time_of_impact.h"

namespace ist {
namespace {

using Rows = std::vector<std::vector<double>>;

void check_rows(const char* what, const Rows& rows, std::size_t waypoints, std::size_t joints) {
  if (rows.size() != waypoints) {
    throw std::invalid_argument("a trajectory of " + std::to_string(waypoints) + " times has " +
                                std::to_string(rows.size()) + " rows of " + what);
  }
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].size() != joints) {
      throw std::invalid_argument("row " + std::to_string(k) + " of " + what + " has " +
                                  std::to_string(rows[k].size()) + " numbers for " +
                                  std::to_string(joints) + " joints");
    }
    for (const double number : rows[k]) {
      if (std::isfinite(number)) continue;
      throw std::invalid_argument("row " + std::to_string(k) + " of " + what +
                                  " has a number that is not finite");
    }
  }
}

void check(const JointTrajectory& trajectory, std::size_t joints) {
  const std::vector<double>& times = trajectory.times;
  if (times.size() < 2) throw std::invalid_argument("a trajectory has two times or more");
  for (std::size_t k = 0; k < times.size(); ++k) {
    const bool rises = k == 0 ? std::isfinite(times[0])
                              : times[k] > times[k - 1] && std::isfinite(times[k] - times[k - 1]);
    if (rises) continue;
    throw std::invalid_argument("times[" + std::to_string(k) + "] is " + std::to_string(times[k]) +
                                ": times have to be finite and to rise");
  }
  check_rows("positions", trajectory.positions, times.size(), joints);
  if (!trajectory.velocities.empty()) {
    check_rows("velocities", trajectory.velocities, times.size(), joints);
  }
  if (trajectory.accelerations.empty()) return;
  check_rows("accelerations", trajectory.accelerations, times.size(), joints);
  if (trajectory.velocities.empty()) {
    throw std::invalid_argument("accelerations need velocities beside them");
  }
}

// Rows by joint of the kinematics; mimic joints follow.
Rows by_joint(const Rows& rows, const std::vector<std::size_t>& free_joints, std::size_t count) {
  Rows all;
  for (const std::vector<double>& row : rows) {
    all.emplace_back(count, kNaN);
    for (std::size_t j = 0; j < row.size(); ++j) all.back()[free_joints[j]] = row[j];
  }
  return all;
}

QueryConfig exact(QueryConfig config) {
  config.tolerance = config.deadline = 0.0;
  return config;
}

// Sets gradients where links are nearest. One thread.
class Gradients {
 public:
  Gradients(const Robot& robot, const QueryConfig& config)
      : forward_(*robot.model(), robot.kinematics()),
        query_(robot.model(), exact(config)),
        rows_(*robot.model(), robot.kinematics()),
        wanted_(robot.links().size(), false) {}

  void set(const StraightPieces& pieces, const Obstacles& obstacles, std::size_t link,
           LinkClearance* found) {
    if (!std::isfinite(found->nearest_time)) return;
    const LinkPoses& poses = forward_.run(positions_at(pieces, found->nearest_time));
    wanted_[link] = true;
    query_.run(poses.X_FL, wanted_, {&obstacles.snapshot()}, &answers_);
    wanted_[link] = false;
    if (answers_[link].state != LinkState::kNear) return;
    rows_.begin(forward_.bodies(), RowConfig());
    rows_.add_link(link, answers_[link]);
    found->gradient.assign(rows_.joints().size(), 0.0);
    if (rows_.rows().count == 0) return;  // no joint moves the link
    for (std::size_t j = 0; j < found->gradient.size(); ++j) {
      found->gradient[j] = -rows_.rows().G(0, static_cast<Eigen::Index>(j));
    }
  }

 private:
  ForwardKinematics forward_;
  ProximityQuery query_;
  ConstraintRowBuilder rows_;
  std::vector<bool> wanted_;  // by link: the one that is being asked
  std::vector<LinkProximity> answers_;
};

}  // namespace

std::vector<LinkClearance> Robot::clearance(Span<const JointTrajectory> trajectories,
                                            const Obstacles& obstacles,
                                            const BatchConfig& config) const {
  const std::size_t count = kinematics()->joints().size();
  std::vector<std::size_t> free_joints;
  for (const std::string& joint : joints()) free_joints.push_back(*kinematics()->find_joint(joint));
  for (const JointTrajectory& trajectory : trajectories) check(trajectory, joints().size());
  // One that is made checks the settings as distances() does.
  distances(std::vector<double>(joints().size(), 0.0), obstacles, config.query);
  std::vector<LinkClearance> results(trajectories.size() * links().size());
  std::atomic<std::size_t> next{0};
  run_on_threads(std::min(trajectories.size(), thread_count(config.threads)), [&](std::size_t) {
    TimeOfImpact impacts(model(), kinematics(), config.query);
    Gradients gradients(*this, config.query);
    std::vector<LinkClearance> found;
    for (std::size_t k; (k = next++) < trajectories.size();) {
      const JointTrajectory& given = trajectories[k];
      const JointTrajectory trajectory{given.times, by_joint(given.positions, free_joints, count),
                                       by_joint(given.velocities, free_joints, count),
                                       by_joint(given.accelerations, free_joints, count)};
      JointPoses still;
      kinematics()->place_joints(trajectory.positions.front(), &still);
      const StraightPieces pieces = straight_pieces(trajectory);
      impacts.run(pieces, trajectory.times.front(), still, Eigen::Isometry3d::Identity(),
                  std::vector<bool>(links().size(), true), {&obstacles.snapshot()}, {}, 0.0, 0.0,
                  &found);
      for (std::size_t i = 0; i < found.size(); ++i) {
        gradients.set(pieces, obstacles, i, &found[i]);
      }
      std::copy(found.begin(), found.end(),
                results.begin() + static_cast<std::ptrdiff_t>(k * links().size()));
    }
  });
  return results;
}

}  // namespace ist
