// A ball that is thrown into a running trajectory, as text for a document: 100 seeded trajectories
// of the demo's arm of 7 joints, watched with clouds at 30 Hz, and stopped at the latest instant at
// which braking helps.
//
// Usage: thrown_ball [--first SEED] [--count N] [--update-doc doc/benchmark.md]

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/link_poses.h"
#include "random_trajectory.h"
#include "support.h"

namespace {

using Eigen::Vector3d;
using ist::StraightPieces;
using ist::benchmark::Arm;
using ist::benchmark::kDuration;
using ist::benchmark::Random;
using ist::benchmark::random_trajectory;
using ist::benchmark::uniform;

constexpr double kPeriod = 1.0 / 30.0;      // [s] of the clouds
constexpr double kDelay = kPeriod + 0.010;  // [s] from a cloud's stamp until its answer counts
constexpr double kDeceleration = 10.0;      // [rad/s^2, m/s^2]
constexpr double kFastest = 3.0;            // [m/s] of a ball
constexpr double kSeen = 1.5;               // [m] farther obstacles are not looked for
constexpr double kMargin = 0.01;            // [m] for what is between the points of a ball
constexpr double kRadius = 0.1;             // [m] of a ball
constexpr double kWall = 2.5;               // [m] the distance of the wall behind it
constexpr double kInf = std::numeric_limits<double>::infinity();

// Flies straight on, and is seen from `begin` on.
struct Ball {
  double begin;  // [s]
  Vector3d from, velocity;

  Vector3d at(double time) const { return from + velocity * (time - begin); }
  bool is_there(double time) const { return time >= begin; }
};

// Aimed at a link or past it.
Ball random_ball(const Arm& arm, const StraightPieces& pieces, Random* random) {
  const double speed = uniform(random, 1.0, kFastest), way = uniform(random, 1.8, 2.2);
  const double hit = uniform(random, way / speed, kDuration);
  ist::ForwardKinematics forward(*arm.model, arm.kinematics);
  forward.run(ist::positions_at(pieces, hit));
  const std::size_t link = arm.random_link(random);
  const double turn = uniform(random, -1.5, 1.5), up = uniform(random, -0.2, 0.9);
  const Vector3d back(std::cos(turn) * std::cos(up), std::sin(turn) * std::cos(up), std::sin(up));
  const Vector3d past(uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3),
                      uniform(random, -0.3, 0.3));
  const Vector3d aim = forward.links().X_FL[link] * arm.model->links[link].tree.center() + past;
  return {hit - way / speed, aim + way * back, -speed * back};
}

// Points all over a ball, no point of which is farther than 4 mm from the nearest.
std::vector<Vector3d> ball_points(const Vector3d& center) {
  constexpr int kPoints = 4000;
  std::vector<Vector3d> points;
  for (int i = 0; i < kPoints; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / kPoints, r = std::sqrt(1.0 - z * z);
    const double turn = i * 2.399963229728653;
    points.push_back(center + kRadius * Vector3d(r * std::cos(turn), r * std::sin(turn), z));
  }
  return points;
}

// An image of 640 x 480 points.
std::vector<float> wall_image() {
  std::vector<float> points;
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const Eigen::Vector3d p = kWall * Vector3d(1.0, (320 - u) / 500.0, (240 - v) / 500.0);
      for (const double x : p) points.push_back(static_cast<float>(x));
    }
  }
  return points;
}

// How the robot brakes: time runs on to `begin` [s], and stands after `way` [s] of the trajectory.
struct Brake {
  double begin = kInf, way = 0.0;

  // [s] of the trajectory
  double time(double now) const {
    if (now <= begin) return now;
    const double u = std::min((now - begin) / (2.0 * way), 1.0);
    return begin + way * (1.0 - (1.0 - u) * (1.0 - u));
  }
  bool stands(double now) const { return now >= begin + 2.0 * way; }
};

// The watch of one trajectory. Its times count from the trajectory's begin.
Brake watch(const Arm& arm, const StraightPieces& pieces, const Ball& ball, double first_stamp) {
  static const std::vector<float> wall = wall_image();
  ist::QueryConfig config;
  config.max_distance = kSeen;
  config.margin = kMargin;
  ist::TimeOfImpact impacts(arm.model, arm.kinematics, config);
  ist::JointPoses still;
  arm.kinematics->place_joints(pieces.positions.front(), &still);
  const std::vector<double> decelerations(arm.kinematics->joints().size(), kDeceleration);
  std::vector<ist::LinkClearance> found;
  Brake brake;
  for (double stamp = first_stamp; stamp + kDelay < kDuration; stamp += kPeriod) {
    const double now = stamp + kDelay;
    if (brake.begin <= now) return brake;  // before this answer
    std::vector<Vector3d> points;
    if (ball.is_there(stamp)) points = ball_points(ball.at(stamp));
    const auto image = ist::Obstacles::from_image(wall.data(), 640, 480);
    const ist::Obstacles seen(points);
    const double delay = ist::braking_way(pieces, now, kDuration, decelerations);
    impacts.run(pieces, now, still, Eigen::Isometry3d::Identity(), arm.moves,
                {&image.snapshot(), &seen.snapshot()}, {}, kFastest, kDelay + delay, &found);
    double contact = kInf;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!arm.moves[i] || !arm.model->links[i].usable()) continue;
      contact = std::isnan(found[i].contact_time) ? now : std::min(contact, found[i].contact_time);
    }
    brake = Brake();
    if (contact < kInf) {
      brake.way = ist::braking_way(pieces, now, contact, decelerations);
      brake.begin = std::max(now, contact - brake.way);
    }
  }
  return brake;
}

// The first contact of a moved robot with a ball [s], and the least distance [m] until then.
struct Contact {
  double time = kInf, distance = kInf;
};

Contact first_contact(const Arm& arm, const StraightPieces& pieces, const Ball& ball,
                      const Brake& brake, double end) {
  constexpr double kStep = 1e-3, kClosing = 15.0;  // [s], [m/s]
  ist::ForwardKinematics forward(*arm.model, arm.kinematics);
  ist::QueryConfig config;
  config.max_distance = 3.0;
  config.tolerance = 0.0;
  ist::ProximityQuery query(arm.model, config);
  std::vector<ist::LinkProximity> answers;
  Contact contact;
  for (double now = std::max(ball.begin, 0.0); now < end;) {
    const auto& poses = forward.run(ist::positions_at(pieces, brake.time(now)));
    const ist::Obstacles center(std::vector<Vector3d>{ball.at(now)});
    query.run(poses.X_FL, arm.moves, {&center.snapshot()}, &answers);
    double distance = config.max_distance;
    for (std::size_t i = 0; i < answers.size(); ++i) {
      if (arm.moves[i] && answers[i].state >= ist::LinkState::kNear) {
        distance = std::min(distance, answers[i].distance);
      }
    }
    distance -= kRadius;
    contact.distance = std::min(contact.distance, distance);
    if (distance <= 0.0) {
      contact.time = now;
      return contact;
    }
    now += std::max(kStep, distance / kClosing);
  }
  return contact;
}

struct Totals {
  int would_touch = 0, moving = 0, stopped = 0, unneeded = 0;
  std::vector<double> missed;  // [mm] by which a ball would have missed, of unneeded stops
};

void run_seed(const Arm& arm, std::uint64_t seed, Totals* totals) {
  Random random(seed);
  const StraightPieces pieces = ist::straight_pieces(random_trajectory(arm, &random));
  const Ball ball = random_ball(arm, pieces, &random);
  const double first_stamp = uniform(&random, -kPeriod, 0.0);
  const Brake brake = watch(arm, pieces, ball, first_stamp);
  const Contact unwatched = first_contact(arm, pieces, ball, Brake(), kDuration);
  const Contact watched = first_contact(arm, pieces, ball, brake, kDuration + 1.0);
  const bool touches = unwatched.time < kInf, stops = brake.begin < kInf;
  totals->would_touch += touches ? 1 : 0;
  totals->stopped += stops ? 1 : 0;
  if (stops && !touches) {
    ++totals->unneeded;
    totals->missed.push_back(1e3 * unwatched.distance);
  }
  const bool stands = brake.stands(watched.time) || watched.time >= kDuration;
  totals->moving += watched.time < kInf && !stands ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  using ist::benchmark::quantile;
  std::size_t count = 100;
  ist::benchmark::CommandLine line("Balls that are thrown into running trajectories.");
  line.add_option("--count", count, "Balls");
  line.read(argc, argv);
  const Arm arm;
  Totals totals;
  for (std::size_t i = 0; i < count; ++i) run_seed(arm, i + 1, &totals);
  return line.publish(
      "thrown ball",
      ist::benchmark::text_of(
          "Of %zu balls %d would touch; %d touched the moving arm. It stopped %d times, %d times "
          "for a ball that\nwould have missed, by %.0f mm in the median.\n",
          count, totals.would_touch, totals.moving, totals.stopped, totals.unneeded,
          quantile(totals.missed, 0.5)));
}
