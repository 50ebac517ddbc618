#include "ist_proximity/facade/robot.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/regular_file.h"
#include "internal/robot/mesh_size.h"
#include "internal/robot/package_resolver.h"
#include "internal/robot/robot_bytes.h"
#include "ist_proximity/geometry/error.h"
#include "query_pool.h"

namespace ist {
namespace {

/// A text that begins with '<' is a URDF; anything else is the path of one.
bool is_path(const std::string& urdf) {
  const std::size_t first = urdf.find_first_not_of(" \t\r\n");
  return first == std::string::npos || urdf[first] != '<';
}

std::string urdf_text(const std::string& urdf) {
  if (!is_path(urdf)) return urdf;
  std::string text;
  const std::string problem = read_regular_file(urdf, kMaxDescriptionSize, &text);
  if (!problem.empty()) throw ModelError("URDF file '" + printable(urdf) + "' " + problem);
  return text;
}

/// Refuses links that cannot be used: what is asked about the robot would leave them out.
void check_links(const RobotParts& parts, bool allow_unknown) {
  std::string names, first;
  std::size_t unknown = 0;
  const std::vector<LinkModel>& links = parts.model->links;
  for (const LinkModel& link : links) {
    if (link.usable()) continue;
    if (unknown == 0) first = link.error;
    if (++unknown <= 5) names += (names.empty() ? "'" : ", '") + link.name + "'";
  }
  if (unknown == 0 && !links.empty()) return;
  const std::string robot = "robot '" + parts.description.name + "'";
  if (unknown == links.size()) {
    throw ModelError(robot +
                     " has no usable link: " + (links.empty() ? "no link has geometry" : first));
  }
  if (allow_unknown) return;
  throw ModelError(std::to_string(unknown) + " of the " + std::to_string(links.size()) +
                   " links of " + robot + " cannot be used (" + names +
                   (unknown > 5 ? ", ..." : "") + "): " + first +
                   "; correct them, name the others as `links`, or set allow_unknown_links, where "
                   "they are UNKNOWN");
}

void check_at_least_0(const char* name, double value) {
  if (value >= 0.0 && std::isfinite(value)) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                              "; it must be at least 0 and finite");
}

void check(const QueryConfig& config) {
  if (!(config.max_distance > 0.0)) {
    throw std::invalid_argument("max_distance is " + std::to_string(config.max_distance) +
                                " m; it must be > 0");
  }
  check_at_least_0("tolerance [m]", config.tolerance);
  check_at_least_0("deadline [s]", config.deadline);
  check_at_least_0("margin [m]", config.margin);
  if (!(config.relative_tolerance >= 0.0 && config.relative_tolerance <= 1.0)) {
    throw std::invalid_argument("relative_tolerance is " +
                                std::to_string(config.relative_tolerance) +
                                "; it must be from 0 to 1");
  }
}

}  // namespace

struct Robot::Impl {
  explicit Impl(RobotParts robot)
      : parts(std::move(robot)),
        kinematics(std::make_shared<const Kinematics>(parts.description)),
        pool([this] { return std::make_unique<QueryWorker>(parts.model, kinematics); }) {
    for (const LinkModel& link : parts.model->links) links.push_back(link.name);
    for (std::size_t j = 0; j < kinematics->joints().size(); ++j) {
      const Kinematics::Joint& joint = kinematics->joints()[j];
      if (joint.source != j) mimics.push_back(j);
      if (!joint.is_free()) continue;
      joints.push_back(joint.name);
      free_joints.push_back(j);
      lower.push_back(joint.lower);
      upper.push_back(joint.upper);
    }
  }

  /// The number of configurations in q.
  std::size_t count(Span<const double> q) const {
    if (joints.empty() && q.empty()) return 1;
    if (!joints.empty() && q.size() % joints.size() == 0) return q.size() / joints.size();
    throw std::invalid_argument("a configuration has one position for each of the robot's " +
                                std::to_string(joints.size()) + " joints; " +
                                std::to_string(q.size()) + " numbers were given");
  }

  void check_single(Span<const double> q) const {
    if (q.size() == joints.size() || q.size() == joints.size() + mimics.size()) return;
    throw std::invalid_argument("the robot has " + std::to_string(joints.size()) +
                                " joints with a position of their own; " +
                                std::to_string(q.size()) + " positions were given");
  }

  /// @param q  one configuration; with or without positions of the mimic joints
  const LinkPoses& place(Span<const double> q, QueryWorker* worker) const {
    for (std::size_t j = 0; j < free_joints.size(); ++j) {
      worker->q[free_joints[j]] = std::isfinite(q[j]) ? q[j] : kNaN;
    }
    const bool states_mimics = q.size() > free_joints.size();
    for (std::size_t m = 0; m < mimics.size(); ++m) {
      worker->q[mimics[m]] = states_mimics ? q[free_joints.size() + m] : kNaN;
    }
    return worker->forward.run(worker->q);
  }

  /// Calls answer(worker, poses, k) for each of n configurations.
  template <class Answer>
  void for_each(Span<const double> q, std::size_t n, const BatchConfig& config,
                const Answer& answer) const {
    const std::size_t size = n > 0 ? q.size() / n : 0;
    pool.run(n, config.threads, config.query, [&](QueryWorker* worker, std::size_t k) {
      answer(worker, place({q.data() + k * size, size}, worker), k);
    });
  }

  std::vector<LinkProximity> distances(Span<const double> q, std::size_t n,
                                       const Obstacles& obstacles,
                                       const BatchConfig& config) const {
    check(config.query);
    std::vector<LinkProximity> results(n * links.size());
    for_each(q, n, config, [&](QueryWorker* worker, const LinkPoses& poses, std::size_t k) {
      worker->query.run(poses.X_FL, poses.known, {&obstacles.snapshot()}, &worker->results);
      std::copy(worker->results.begin(), worker->results.end(),
                results.begin() + static_cast<std::ptrdiff_t>(k * links.size()));
    });
    return results;
  }

  std::vector<RobotProximity> nearest(Span<const double> q, std::size_t n,
                                      const Obstacles& obstacles, const BatchConfig& config) const {
    check(config.query);
    std::vector<RobotProximity> results(n);
    for_each(q, n, config, [&](QueryWorker* worker, const LinkPoses& poses, std::size_t k) {
      worker->query.run_minimum(poses.X_FL, poses.known, {&obstacles.snapshot()}, &results[k]);
    });
    return results;
  }

  RobotParts parts;
  std::shared_ptr<const Kinematics> kinematics;
  std::vector<std::string> links, joints;
  std::vector<std::size_t> free_joints;  // by joint: its index in the kinematics
  std::vector<std::size_t> mimics;       // indices in the kinematics
  std::vector<double> lower, upper;      // by joint
  mutable QueryPool pool;
};

Robot::Robot(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Robot::Robot(const std::string& urdf, const RobotConfig& config) {
  const std::string text = urdf_text(urdf);
  RobotParts parts;
  const PackageFinder finder =
      config.find_package ? config.find_package
                          : file_package_finder(is_path(urdf) ? urdf : "", config.package_dirs);
  const auto may_go_on = [&](const std::string&, const std::string&) {
    return !config.callbacks.cancelled || !config.callbacks.cancelled();
  };
  parts.description = parse_urdf(text, config.geometry, finder, may_go_on);
  if (config.callbacks.warning) {
    for (const std::string& doubt : doubtful_sizes(parts.description, config.links)) {
      config.callbacks.warning(doubt);
    }
    const std::string no_limits = doubtful_limits(parts.description);
    if (!no_limits.empty()) config.callbacks.warning(no_limits);
  }
  RobotModelConfig model_config;
  model_config.packing = config.packing;
  model_config.cache_directory = config.cache_directory;
  model_config.links = config.links;
  model_config.distance_fields = config.distance_fields;
  parts.model = build_robot_model(parts.description, model_config, config.callbacks);
  if (!parts.model) throw ModelError("building the robot was cancelled");
  check_links(parts, config.allow_unknown_links);
  impl_ = std::make_shared<Impl>(std::move(parts));
}

const std::string& Robot::name() const { return impl_->parts.description.name; }
const std::vector<std::string>& Robot::links() const { return impl_->links; }
const std::vector<std::string>& Robot::joints() const { return impl_->joints; }
const std::vector<double>& Robot::lower_limits() const { return impl_->lower; }
const std::vector<double>& Robot::upper_limits() const { return impl_->upper; }
const RobotDescription& Robot::description() const { return impl_->parts.description; }
const std::shared_ptr<const RobotModel>& Robot::model() const { return impl_->parts.model; }
const std::shared_ptr<const Kinematics>& Robot::kinematics() const { return impl_->kinematics; }

std::vector<double> Robot::configuration(const std::map<std::string, double>& positions,
                                         double other) const {
  const std::vector<std::size_t>& mimics = impl_->mimics;
  std::vector<double> q(joints().size(), other);
  for (const auto& [joint, position] : positions) {
    const auto found = std::find(joints().begin(), joints().end(), joint);
    if (found != joints().end()) {
      q[static_cast<std::size_t>(found - joints().begin())] = position;
      continue;
    }
    const std::optional<std::size_t> at = kinematics()->find_joint(joint);
    const auto mimic = at ? std::find(mimics.begin(), mimics.end(), *at) : mimics.end();
    if (mimic == mimics.end()) {
      throw std::invalid_argument("robot '" + name() + "' has no joint '" + printable(joint) +
                                  "' with a position");
    }
    q.resize(joints().size() + mimics.size(), std::numeric_limits<double>::quiet_NaN());
    // NaN follows the other joint: what is stated and not known must not.
    q[joints().size() + static_cast<std::size_t>(mimic - mimics.begin())] =
        std::isfinite(position) ? position : std::numeric_limits<double>::infinity();
  }
  return q;
}

LinkPoses Robot::link_poses(Span<const double> q) const {
  impl_->check_single(q);
  LinkPoses poses;
  impl_->for_each(q, 1, {{}, 1},
                  [&](QueryWorker*, const LinkPoses& placed, std::size_t) { poses = placed; });
  return poses;
}

std::vector<LinkProximity> Robot::distances(Span<const double> q, const Obstacles& obstacles,
                                            const QueryConfig& config) const {
  impl_->check_single(q);
  return impl_->distances(q, 1, obstacles, {config, 1});
}

RobotProximity Robot::nearest(Span<const double> q, const Obstacles& obstacles,
                              const QueryConfig& config) const {
  impl_->check_single(q);
  return impl_->nearest(q, 1, obstacles, {config, 1}).front();
}

std::vector<LinkProximity> Robot::distances_batch(Span<const double> q, const Obstacles& obstacles,
                                                  const BatchConfig& config) const {
  return impl_->distances(q, impl_->count(q), obstacles, config);
}

std::vector<RobotProximity> Robot::nearest_batch(Span<const double> q, const Obstacles& obstacles,
                                                 const BatchConfig& config) const {
  return impl_->nearest(q, impl_->count(q), obstacles, config);
}

std::vector<LinkProximity> Robot::distances_at(Span<const Eigen::Isometry3d> X_FL,
                                               const Obstacles& obstacles,
                                               const BatchConfig& config) const {
  check(config.query);
  const std::size_t links = impl_->links.size();
  if (X_FL.size() % links != 0) {
    throw std::invalid_argument("a configuration has one pose for each of the " +
                                std::to_string(links) + " links; " + std::to_string(X_FL.size()) +
                                " poses were given");
  }
  for (std::size_t i = 0; i < X_FL.size(); ++i) {
    if (X_FL[i].matrix().allFinite() && !is_rigid(X_FL[i])) {
      throw std::invalid_argument("pose " + std::to_string(i) + ", of link '" +
                                  impl_->links[i % links] + "', is not rigid");
    }
  }
  std::vector<LinkProximity> results(X_FL.size());
  const auto answer = [&](QueryWorker* worker, std::size_t k) {
    const Span<const Eigen::Isometry3d> poses(X_FL.data() + k * links, links);
    for (std::size_t i = 0; i < links; ++i) worker->known[i] = poses[i].matrix().allFinite();
    worker->query.run(poses, worker->known, {&obstacles.snapshot()}, &worker->results);
    std::copy(worker->results.begin(), worker->results.end(),
              results.begin() + static_cast<std::ptrdiff_t>(k * links));
  };
  impl_->pool.run(X_FL.size() / links, config.threads, config.query, answer);
  return results;
}

std::string Robot::to_bytes() const { return serialize_robot(impl_->parts); }

Robot Robot::from_bytes(const std::string& bytes) {
  return Robot(std::make_shared<const Impl>(parse_robot(bytes)));
}

}  // namespace ist
