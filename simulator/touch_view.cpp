#include "touch_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "internal/geometry/ray_cast.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "scene.h"
#include "self_view.h"
#include "simulation.h"

namespace ist::sim {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kTold = 0.005;               // [m]
constexpr double kAway = 0.05;                // [m]
constexpr double kStart = 3.0;                // [s] of motion at first
constexpr double kBetween = 0.5;              // [s] of motion between two places
constexpr double kSpeed = 0.2;                // [m/s] of the bar
constexpr double kFar = 0.15;                 // [m] where the bar comes from
const Eigen::Vector3d kBar(0.03, 0.03, 0.1);  // [m] it touches with an end

Eigen::Vector3d random_direction(Rng* rng) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(*rng), normal(*rng), normal(*rng)).normalized();
}

// A place where the bar touches.
struct Place {
  double begin;              // [s] when the arm stands still and the bar begins to come near
  double arm_time;           // [s] of the arm's motion
  Eigen::Vector3d p_F, n_F;  // where the bar's end touches, and its axis
  std::size_t link;
};

double coming() { return kFar / kSpeed; }

// The arm's motion stands still while the bar is near.
double arm_time(const std::vector<Place>& places, double hold, double t) {
  double moving = t;
  for (const Place& place : places) {
    if (t < place.begin) break;
    moving -= std::min(t - place.begin, 2.0 * coming() + hold);
  }
  return moving;
}

// [m] of the bar's end from the place.
double bar_distance(const Place& place, double hold, double t) {
  const double since = t - place.begin;
  if (since < 0.0 || since > 2.0 * coming() + hold) return kInf;
  if (since < coming()) return kFar - kSpeed * since;
  return std::max(0.0, kSpeed * (since - coming() - hold));
}

Eigen::Matrix3d frame_along(const Eigen::Vector3d& z, const Eigen::Vector3d& about) {
  Eigen::Matrix3d R;
  const Eigen::Vector3d x = about.cross(z).normalized();
  R << x, z.cross(x), z;
  return R;
}

struct View {
  const RobotModel& model;
  const std::vector<Eigen::Isometry3d>& X_FL;
  Eigen::Vector3d eye;

  // The first link on a ray.
  RayHit cast(const Eigen::Vector3d& direction, std::size_t* link) const {
    RayHit best;
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      const Eigen::Isometry3d X_LF = X_FL[i].inverse();
      RayHit hit = ray_cast(model.links[i].solid, X_LF * eye, X_LF.linear() * direction, best.t);
      if (!(hit.t < best.t)) continue;
      hit.normal = X_FL[i].linear() * hit.normal;
      best = hit;
      *link = i;
    }
    return best;
  }
};

Obstacle bar_at(const Place& place) {
  Obstacle bar;
  bar.shape = Box{kBar};
  bar.R_FO = frame_along(place.n_F, Eigen::Vector3d(0.1, 0.9, 0.3).normalized());
  bar.from = place.p_F + 0.5 * kBar.z() * place.n_F;
  return bar;
}

// [m] The least distance to the arm of the bar's points that a perfect camera sees.
double visible_distance(const View& view, const Obstacle& bar) {
  const Eigen::Isometry3d X_FO = bar.pose(0.0), X_OF = X_FO.inverse();
  GeometryElement element;
  element.shape = bar.shape;
  const Solid solid({element});
  double least = kInf;
  const auto steps = [](double size) { return static_cast<int>(size / 0.001); };
  for (int axis = 0; axis < 3; ++axis) {  // every millimetre of its faces
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (double side : {-0.5, 0.5}) {
      for (int i = 0; i <= steps(kBar[u]); ++i) {
        for (int j = 0; j <= steps(kBar[v]); ++j) {
          Eigen::Vector3d p_O;
          p_O[axis] = side * kBar[axis];
          p_O[u] = 0.001 * i - 0.5 * kBar[u];
          p_O[v] = 0.001 * j - 0.5 * kBar[v];
          const Eigen::Vector3d p = X_FO * p_O, d = p - view.eye;
          if (ray_cast(solid, X_OF * view.eye, X_OF.linear() * d).t < 1.0 - 1e-6) continue;
          std::size_t link = 0;
          if (view.cast(d, &link).t < 1.0 - 1e-6) continue;
          for (std::size_t k = 0; k < view.model.links.size(); ++k) {
            least = std::min(
                least,
                view.model.links[k].solid.signed_distance(view.X_FL[k].inverse() * p).distance);
          }
        }
      }
    }
  }
  return least;
}

// Chooses a place in view that commanded joints move, at which the bar touches nothing else.
bool find_place(const RobotModel& model, const Arm& arm, const DepthCameraConfig& camera,
                double in_view, Rng* rng, Place* place) {
  const std::vector<Eigen::Isometry3d> X_FL = arm.link_poses(self_view_positions(place->arm_time));
  const View view{model, X_FL, camera.X_FC.translation()};
  std::uniform_real_distribution<double> u(-0.5, 0.5);
  for (int attempt = 0; attempt < 20000; ++attempt) {
    const Eigen::Vector3d d =
        camera.X_FC.linear() * Eigen::Vector3d(u(*rng) * camera.width / camera.focal_length,
                                               u(*rng) * camera.height / camera.focal_length, 1.0);
    std::size_t link = 0;
    const RayHit hit = view.cast(d, &link);
    if (!std::isfinite(hit.t) || link < 2) continue;
    place->link = link;
    place->n_F = hit.normal;
    place->p_F = view.eye + hit.t * d;
    // The end touches where it is pushed along its axis until it meets the arm.
    const Obstacle bar = bar_at(*place);
    double overlap = kInf;
    for (std::size_t k = 0; k < model.links.size(); ++k) {
      overlap = std::min(overlap, distance(model.links[k].solid, X_FL[k], bar, bar.pose(0.0), 0.1));
    }
    if (overlap < -1e-4 || overlap > 1e-4) continue;
    if (visible_distance(view, bar) <= in_view) return true;
  }
  return false;
}

struct Trial {
  Ingest ingest;
  ProximityQuery query;
  CloudSnapshot cloud;
  TouchResult result;
  std::vector<LinkProximity> answers;
  int told_here = 0, answers_here = 0;

  Trial(const std::shared_ptr<const RobotModel>& model, const IngestConfig& config)
      : ingest(config), query(model, {}) {}

  void end_place() {
    if (2 * told_here > answers_here) ++result.places_told;
    told_here = answers_here = 0;
  }
};

double smallest(const std::vector<LinkProximity>& answers) {
  double distance = kInf;
  for (const LinkProximity& link : answers) {
    if (link.state != LinkState::kUnknown) distance = std::min(distance, link.distance);
  }
  return distance;
}

void count(double distance, bool touches, bool is_away, Trial* trial) {
  TouchResult& result = trial->result;
  if (touches) {
    ++result.answers;
    ++trial->answers_here;
    result.mean += std::min(distance, 0.1);
    result.contacts += distance < 0.0 ? 1 : 0;
    result.told += distance <= kTold ? 1 : 0;
    trial->told_here += distance <= kTold ? 1 : 0;
  } else if (is_away) {
    ++result.free_answers;
    result.false_answers += distance <= kTold ? 1 : 0;
  }
}

/// The places that are in view. A place begins when the one before it has ended.
std::vector<Place> find_places(const RobotModel& model, const Arm& arm,
                               const DepthCameraConfig& camera, const TouchConfig& config,
                               double stop) {
  Rng rng(config.seed);
  std::vector<Place> places;
  for (int i = 0; i < config.places; ++i) {
    Place place;
    place.arm_time = kStart + kBetween * i;
    place.begin = place.arm_time + stop * i;
    if (!find_place(model, arm, camera, config.in_view, &rng, &place)) continue;
    place.begin = place.arm_time + stop * static_cast<double>(places.size());
    places.push_back(place);
  }
  return places;
}

/// One bar for each place, which is out of view at all other times.
std::vector<Obstacle> bars_at(const std::vector<Place>& places, double hold) {
  std::vector<Obstacle> bars;
  bars.reserve(places.size());
  for (const Place& place : places) {
    Obstacle bar = bar_at(place);
    bar.path = [place, hold, at = bar.from](double t) -> Eigen::Vector3d {
      const double away = bar_distance(place, hold, t);
      return std::isfinite(away) ? Eigen::Vector3d(at + away * place.n_F)
                                 : Eigen::Vector3d(0.0, 0.0, -50.0);
    };
    bars.push_back(bar);
  }
  return bars;
}

/// Whether nothing is near the arm, now and when the newest cloud was taken.
bool is_all_away(const Simulation& world, double then) {
  return !(world.nearest_then(kAway, then).distance < kAway) &&
         !(world.nearest(kAway).distance < kAway);
}

TouchResult result_of(const Trial& trial) {
  TouchResult result = trial.result;
  result.mean /= std::max(result.answers, 1);
  result.offset = trial.cloud.view.offset;
  for (const LinkView& link : trial.cloud.view.links) {
    result.blind_skin = std::max(result.blind_skin, link.blind_skin);
  }
  return result;
}

}  // namespace

Eigen::Isometry3d with_error(const Eigen::Isometry3d& X_FS, double position, double angle,
                             std::uint64_t seed) {
  Rng rng(seed);
  Eigen::Isometry3d X_SE = Eigen::Isometry3d::Identity();
  X_SE.linear() = Eigen::AngleAxisd(angle, random_direction(&rng)).toRotationMatrix();
  X_SE.translation() = position * random_direction(&rng);
  return X_FS * X_SE;
}

std::vector<TouchResult> run_touch(const RobotDescription& robot,
                                   const std::shared_ptr<const RobotModel>& model,
                                   const TouchConfig& config) {
  DepthCameraConfig camera = demo_cameras()[0];
  camera.width *= config.resolution;
  camera.height *= config.resolution;
  camera.focal_length *= config.resolution;
  camera.noise = config.noise;
  camera.latency = config.latency;
  camera.period = 1.0 / 15.0;
  const Eigen::Isometry3d X_FS =
      with_error(camera.X_FC, config.position_error, config.angle_error, config.seed);

  const Arm arm(robot, demo_arm());
  const double hold = config.latency + camera.period + config.hold, stop = 2.0 * coming() + hold;
  const std::vector<Place> places = find_places(*model, arm, camera, config, stop);
  Simulation world(robot, demo_arm(), bars_at(places, hold), {camera}, config.seed);
  world.arm().reset(self_view_positions(0.0));
  std::vector<Trial> trials;
  for (const IngestConfig& filter : config.filters) trials.emplace_back(model, filter);

  const std::vector<bool> known(robot.links.size(), true);
  const double end = kStart + (stop + kBetween) * static_cast<double>(places.size());
  std::size_t at = 0;
  bool has_cloud = false;
  for (int step = 0; world.time() < end; ++step) {
    const double t = world.time();
    const Eigen::VectorXd next = self_view_positions(arm_time(places, hold, t + Simulation::kStep));
    world.step((next - world.arm().positions()) / Simulation::kStep);
    if (at < places.size() && t > places[at].begin + stop) {
      ++at;
      for (Trial& trial : trials) trial.end_place();
    }
    for (const Picture& picture : world.take_pictures()) {
      const std::vector<PosedSolid> posed =
          posed_solids(*model, world.link_poses(picture.stamp), known);
      for (Trial& trial : trials) {
        trial.ingest.run(picture.raw(), X_FS, posed, picture.stamp, &trial.cloud);
      }
      has_cloud = true;
    }
    if (step % 20 != 0 || !has_cloud || at >= places.size()) continue;
    const double since = t - places[at].begin - coming();
    const bool touches = since >= config.latency + camera.period && since <= hold;
    const double then = t - config.latency - camera.period;
    const bool is_away = is_all_away(world, then);
    if (!touches && !is_away) continue;
    const std::vector<Eigen::Isometry3d> X_FL = world.link_poses();
    for (Trial& trial : trials) {
      trial.query.run(X_FL, known, {&trial.cloud}, &trial.answers);
      count(smallest(trial.answers), touches, is_away, &trial);
    }
  }
  std::vector<TouchResult> results;
  for (Trial& trial : trials) {
    if (at < places.size()) trial.end_place();
    results.push_back(result_of(trial));
  }
  return results;
}

}  // namespace ist::sim
