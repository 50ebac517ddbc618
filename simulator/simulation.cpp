#include "simulation.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ist::sim {
namespace {

constexpr std::size_t kHistory = 2001;  // steps

std::int64_t steps_of(double seconds) { return std::llround(seconds / Simulation::kStep); }

}  // namespace

RawCloud Picture::raw() const {
  return packed_cloud(reinterpret_cast<const float*>(points.data()),
                      static_cast<std::size_t>(width), static_cast<std::size_t>(height));
}

Simulation::Simulation(const RobotDescription& robot, const ArmConfig& arm,
                       const std::vector<Obstacle>& obstacles,
                       const std::vector<DepthCameraConfig>& cameras, std::uint64_t seed)
    : arm_(robot, arm), obstacles_(obstacles), rng_(seed) {
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    LinkBody body{Solid(robot.links[i].geometry), Eigen::Vector3d::Zero(), 0.0};
    const std::size_t begin = elements_.size();
    for (const GeometryElement& element : robot.links[i].geometry) {
      elements_.push_back({i, RayShape(element.shape), element.X_LE});
      body.center += element.X_LE * elements_.back().shape.center();
    }
    body.center /= static_cast<double>(std::max<std::size_t>(robot.links[i].geometry.size(), 1));
    for (std::size_t e = begin; e < elements_.size(); ++e) {
      const Element& element = elements_[e];
      const double beside = (element.X_LE * element.shape.center() - body.center).norm();
      body.radius = std::max(body.radius, beside + element.shape.radius());
    }
    bodies_.push_back(std::move(body));
  }
  std::vector<Body> background;
  seen_obstacles_.reserve(obstacles_.size());
  for (const Obstacle& obstacle : obstacles_) seen_obstacles_.emplace_back(obstacle.shape);
  for (std::size_t i = 0; i < obstacles_.size(); ++i) {
    if (obstacles_[i].is_fixed()) {
      background.push_back({&seen_obstacles_[i], obstacles_[i].pose(0.0)});
    }
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    cameras_.emplace_back(cameras[i], background);
    // The cameras are out of phase.
    next_picture_.push_back(
        steps_of(cameras[i].period * static_cast<double>(i) / static_cast<double>(cameras.size())));
  }
  history_.push_back(arm_.positions());
}

void Simulation::step(const Eigen::VectorXd& command) {
  history_.back() = arm_.positions();  // reset() may have moved it
  take_pictures_now();
  arm_.step(command, kStep);
  ++steps_;
  history_.push_back(arm_.positions());
  if (history_.size() > kHistory) history_.pop_front();
}

std::vector<Eigen::Isometry3d> Simulation::link_poses(double time) const {
  const std::int64_t back = std::clamp<std::int64_t>(
      steps_ - steps_of(time), 0, static_cast<std::int64_t>(history_.size()) - 1);
  return arm_.link_poses(history_[history_.size() - 1 - static_cast<std::size_t>(back)]);
}

void Simulation::take_pictures_now() {
  std::vector<Body> bodies;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (steps_ < next_picture_[c]) continue;
    const DepthCameraConfig& config = cameras_[c].config();
    next_picture_[c] += std::max<std::int64_t>(steps_of(config.period), 1);
    if (!cameras_alive_) continue;
    if (bodies.empty()) {
      const std::vector<Eigen::Isometry3d> X_FL = link_poses();
      for (const Element& e : elements_) bodies.push_back({&e.shape, X_FL[e.link] * e.X_LE});
      for (std::size_t i = 0; i < obstacles_.size(); ++i) {
        if (!obstacles_[i].is_fixed()) {
          bodies.push_back({&seen_obstacles_[i], obstacles_[i].pose(time())});
        }
      }
    }
    under_way_.push_back(
        {c, time(), config.width, config.height, cameras_[c].picture(bodies, &rng_)});
  }
}

std::vector<Picture> Simulation::take_pictures() {
  std::vector<Picture> arrived;
  for (auto it = under_way_.begin(); it != under_way_.end();) {
    const double latency = cameras_[it->camera].config().latency;
    if (steps_of(it->stamp + latency) <= steps_) {
      arrived.push_back(std::move(*it));
      it = under_way_.erase(it);
    } else {
      ++it;
    }
  }
  return arrived;
}

Simulation::Truth Simulation::nearest_then(double max_distance, double when) const {
  Truth truth{std::numeric_limits<double>::infinity()};
  double limit = max_distance;
  const std::vector<Eigen::Isometry3d> X_FL = link_poses();
  for (std::size_t o = 0; o < obstacles_.size(); ++o) {
    const Eigen::Isometry3d X_FO = obstacles_[o].pose(when);
    const Eigen::Isometry3d X_OF = X_FO.inverse();
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      if (!arm_.moved()[i]) continue;
      const LinkBody& body = bodies_[i];
      // The bounding sphere's distance to the obstacle is a lower bound.
      const Eigen::Vector3d c_O = X_OF * (X_FL[i] * body.center);
      double bound = c_O.norm() - obstacles_[o].radius();
      if (const auto* box = std::get_if<Box>(&obstacles_[o].shape)) {
        bound = (c_O.cwiseAbs() - 0.5 * box->size).cwiseMax(0.0).norm();
      }
      if (bound - body.radius >= limit) continue;
      const double d = distance(body.solid, X_FL[i], obstacles_[o], X_FO, limit);
      if (d < limit) {
        truth = {d, i, o};
        limit = d;
      }
    }
  }
  return truth;
}

}  // namespace ist::sim
