// How soon the node cancels a goal for a ball that appears just before a moving robot: the time
// from the stamp of the first cloud with the ball until the cancel message arrives. The node is a
// process of its own, with 640x480 clouds at 30 Hz, joint states at 1 kHz, and a trajectory of 5 s
// of the demo's arm a ball. A roscore must be running.

#include <ros/ros.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "internal/geometry/numbers.h"
#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "random_trajectory.h"
#include "ros/reaction/world.h"
#include "support.h"
#include "support/temp_dir.h"

namespace ist::benchmark {
namespace {

using Eigen::Vector3d;

constexpr double kDeceleration = 2.0;  // [rad/s^2, m/s^2]
constexpr double kSlow = 0.15;         // [m/s] links that are slower get no ball
constexpr double kLongest = 1.0;       // [s] that a cancel is waited for

/// Finds where a ball is in the way of a link that moves: [m] its centre, or none.
/// @param time  [s] of the trajectory
std::optional<Vector3d> ball_before(const Arm& arm, const StraightPieces& pieces, double time,
                                    Random* random) {
  constexpr double kStep = 0.01;  // [s]
  ForwardKinematics forward(*arm.model, arm.kinematics);
  const LinkPoses later = forward.run(ist::positions_at(pieces, time + kStep));
  const LinkPoses now = forward.run(ist::positions_at(pieces, time));
  const std::size_t link = arm.random_link(random);
  const Vector3d c_L = arm.model->links[link].tree.center();
  const Vector3d velocity = (later.X_FL[link] * c_L - now.X_FL[link] * c_L) / kStep;
  const double gap = velocity.norm() * uniform(random, 0.06, 0.12);
  if (velocity.norm() < kSlow) return std::nullopt;
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(arm.model, config);
  std::vector<LinkProximity> answers;
  for (double way = 0.0; way < 0.5; way += 0.002) {
    const Vector3d center = now.X_FL[link] * c_L + way * velocity.normalized();
    const Obstacles point(std::vector<Vector3d>{center});
    query.run(now.X_FL, now.known, {&point.snapshot()}, &answers);
    double distance = config.max_distance;
    for (const LinkProximity& one : answers) distance = std::min(distance, one.distance);
    if (distance >= kRadius + gap) return center;
  }
  return std::nullopt;
}

struct Totals {
  std::size_t balls = 0;
  std::vector<double> times;  ///< [ms] until the cancel, infinite where none came
};

/// Counts the ball of a seed, if there is one, and its time if braking is due at once.
void run_seed(const Arm& arm, std::uint64_t seed, World* world, Totals* totals) {
  Random random(seed);
  const JointTrajectory path = random_trajectory(arm, &random);
  const StraightPieces pieces = straight_pieces(path);
  const double time = uniform(&random, 0.5, 2.0);
  const auto ball = ball_before(arm, pieces, time, &random);
  if (!ball || !world->sees(*ball)) return;
  world->begin(path, pieces);
  while (ros::ok() && world->time() < time) ros::WallDuration(0.001).sleep();
  if (world->is_clear()) {
    world->put_ball(*ball);
    for (double t = 0.0; ros::ok() && t < kLongest && !world->reaction(); t += 0.05) wait(0.05);
    wait(0.1);  // for the message that says why
    ++totals->balls;
    if (world->is_due()) totals->times.push_back(world->reaction().value_or(kInfinity));
  }
  world->end();
  wait(0.2);
}

std::string react(std::size_t count) {
  const test::TempDir cache;
  ros::param::set("robot_description",
                  test::read_text(IST_PROXIMITY_SOURCE_DIR "/demo/demo_arm.urdf"));
  ros::param::set("reaction_node/pose_source", "joint_states");
  ros::param::set("reaction_node/cache_directory", cache.path());
  ros::param::set("reaction_node/joint_deceleration", kDeceleration);
  ros::param::set("reaction_node/trajectory/cancel_topic", "arm/cancel");
  const Arm arm;
  World world(arm);
  const Process node({IST_PROXIMITY_NODE, "__name:=reaction_node"});
  while (ros::ok() && !world.is_ok()) wait(0.1);
  wait(kPackingTime);
  Totals totals;
  for (std::uint64_t seed = 1; ros::ok() && totals.times.size() < count; ++seed) {
    run_seed(arm, seed, &world, &totals);
  }
  const std::vector<double>& times = totals.times;
  return text_of(
      "%.0f / %.0f / %.0f ms (median, p99, largest) from the cloud's stamp to the cancelled goal, "
      "where\nbraking is due at once (%zu of %zu balls).\n",
      quantile(times, 0.5), quantile(times, 0.99), quantile(times, 1.0), times.size(),
      totals.balls);
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ros::init(argc, argv, "reaction");
  std::size_t count = 100;
  ist::benchmark::CommandLine line("How soon the node cancels a goal for a ball.");
  line.add_option("--count", count, "Balls for which braking is due at once");
  line.read(argc, argv);
  return line.publish("reaction", ist::benchmark::react(count));
}
