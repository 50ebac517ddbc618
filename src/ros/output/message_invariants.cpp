#include "ros/output/message_invariants.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#ifndef NDEBUG
#include <ros/console.h>

#include <cstdlib>
#endif

#include "ros/common/eigen_conversion.h"
#include "ros/common/ros_time.h"
#include "ros/output/message_conversion.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;
using LinkMessage = ist_proximity::LinkProximity;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kRounding = 1e-6;  // relative to the values involved

template <typename Derived>
bool all_nan(const Eigen::MatrixBase<Derived>& v) {
  return v.array().isNaN().all();
}

/// Collects the first statement that does not hold.
class Check {
 public:
  explicit Check(std::string title) : title_(std::move(title)) {}

  template <typename Value>
  void that(bool holds, const char* what, const Value& value) {
    if (holds || !broken_.empty()) return;
    std::ostringstream text;
    text << title_ << what << ", but it is " << value;
    broken_ = text.str();
  }
  const std::string& broken() const { return broken_; }

 private:
  std::string title_, broken_;
};

/// A link's vectors.
struct Vectors {
  explicit Vectors(const LinkMessage& link)
      : point(to_vector(link.point_on_link)),
        local(to_vector(link.point_on_link_local)),
        obstacle(to_vector(link.point_on_obstacle)),
        direction(to_vector(link.direction)) {
    repulsion << to_vector(link.repulsion), to_vector(link.repulsion_torque);
    penetration << to_vector(link.penetration.force), to_vector(link.penetration.torque);
  }
  Eigen::Vector3d point, local, obstacle, direction;
  Vector6 repulsion, penetration;
};

void check_nothing_near(const LinkMessage& link, const Vectors& v, Check* check) {
  check->that(all_nan(v.point) && all_nan(v.local) && all_nan(v.obstacle) && all_nan(v.direction),
              "points and direction have to be NaN", v.point.transpose());
  check->that(link.source.empty(), "source has to be empty", link.source);
  check->that(std::isnan(link.closing_speed), "closing_speed has to be NaN", link.closing_speed);
}

// The parts of distance - lower_bound.
void check_interval(const LinkMessage& link, Check* check) {
  const double sum = link.interval_model + link.interval_tolerance + link.interval_sensor;
  if (link.state < LinkMessage::NEAR) {
    check->that(std::isnan(sum), "the parts of the interval have to be NaN", sum);
    return;
  }
  const double least =
      std::min({link.interval_model, link.interval_tolerance, link.interval_sensor});
  check->that(least >= 0.0, "the parts of the interval must not be negative", least);
  const double width = link.distance - link.lower_bound;
  check->that(sum == width || std::abs(sum - width) <= kRounding * (1.0 + std::abs(width)),
              "the parts of the interval have to add up to it", sum);
}

void check_measured(const LinkMessage& link, const Vectors& v, const InvariantInput& input,
                    Check* check) {
  const bool in_contact = link.state == LinkMessage::CONTACT;
  check->that(std::isfinite(link.distance), "distance has to be finite", link.distance);
  check->that(in_contact ? link.distance < 0.0 : link.distance >= 0.0,
              "the sign of distance has to be the state's", link.distance);
  const double largest = link.distance - input.margin + kRounding * std::abs(link.distance);
  check->that(link.lower_bound <= largest, "lower_bound has to be distance - margin at most",
              link.lower_bound);
  check->that(v.point.allFinite() && v.local.allFinite() && v.obstacle.allFinite(),
              "points have to be finite", v.point.transpose());
  check->that(std::abs(v.direction.norm() - 1.0) < kRounding, "direction has to be a unit vector",
              v.direction.transpose());
  const Eigen::Vector3d error = v.point - v.obstacle - link.distance * v.direction;
  check->that(error.norm() <= kRounding * (1.0 + v.point.norm() + v.obstacle.norm()),
              "points have to lie along direction, distance apart", error.norm());
  check->that(!link.source.empty(), "source has to be named", "empty");
  const bool is_known = v.penetration.allFinite();
  check->that(is_known || all_nan(v.penetration), "penetration has to be known or not",
              v.penetration.transpose());
  check->that(in_contact || !is_known || v.penetration.isZero(0.0),
              "penetration has to be 0 outside contact", v.penetration.transpose());
}

void check_closing(const LinkMessage& link, Check* check) {
  check->that(((link.closing_unknown & LinkMessage::ROBOT_UNKNOWN) != 0) ==
                  std::isnan(link.closing_speed_robot),
              "closing_unknown has to say whether closing_speed_robot is NaN",
              link.closing_speed_robot);
  check->that(((link.closing_unknown & LinkMessage::OBSTACLES_UNKNOWN) != 0) ==
                  std::isnan(link.closing_speed_obstacles),
              "closing_unknown has to say whether closing_speed_obstacles is NaN",
              link.closing_speed_obstacles);
  check->that(!(link.time_to_contact < 0.0), "time_to_contact must not be negative",
              link.time_to_contact);
}

std::string check_link(const LinkMessage& link, const InvariantInput& input) {
  Check check("link '" + link.link + "' in state " + std::to_string(link.state) + ": ");
  const Vectors v(link);
  check_closing(link, &check);
  switch (link.state) {
    case LinkMessage::UNKNOWN:
      check.that(std::isnan(link.distance), "distance has to be NaN", link.distance);
      check.that(link.lower_bound == -std::numeric_limits<double>::infinity(),
                 "lower_bound has to be -inf", link.lower_bound);
      check.that(all_nan(v.repulsion) && all_nan(v.penetration),
                 "repulsion and penetration have to be NaN", v.repulsion.transpose());
      check_nothing_near(link, v, &check);
      break;
    case LinkMessage::CLEAR:
      check.that(link.distance == std::numeric_limits<double>::infinity(),
                 "distance has to be +inf", link.distance);
      check.that(link.lower_bound >= input.max_distance, "lower_bound has to be max_distance",
                 link.lower_bound);
      check.that(v.penetration.isZero(0.0), "penetration has to be 0", v.penetration.transpose());
      check_nothing_near(link, v, &check);
      break;
    case LinkMessage::NEAR:
    case LinkMessage::CONTACT:
      check_measured(link, v, input, &check);
      break;
    default:
      check.that(false, "the state has to be one of the constants", int{link.state});
  }
  check_interval(link, &check);
  if (link.state != LinkMessage::UNKNOWN) {
    check.that(v.repulsion.allFinite() || all_nan(v.repulsion), "repulsion has to be known or not",
               v.repulsion.transpose());
  }
  return check.broken();
}

bool knows_any(const ProximityArray& message) {
  return std::any_of(message.links.begin(), message.links.end(),
                     [](const LinkMessage& link) { return link.state != LinkMessage::UNKNOWN; });
}

/// Whether a source is OK that may vouch for what is free.
bool has_voucher(const ProximityArray& message) {
  const std::string memory = "/memory";
  return std::any_of(message.sources.begin(), message.sources.end(), [&](const auto& source) {
    const std::size_t size = source.name.size(), end = memory.size();
    const bool is_memory = size > end && source.name.compare(size - end, end, memory) == 0;
    return source.status == ProximityArray::OK && !is_memory;
  });
}

#ifndef NDEBUG
void end_if_broken(const std::string& broken, const ProximityArray& message) {
  if (broken.empty()) return;
  ROS_FATAL_STREAM("a message breaks its contract: " << broken << "\n" << message);
  std::abort();
}
#endif

}  // namespace

double least_when_clear(const ServerConfig& config) {
  return config.unknown_space == UnknownSpace::kObstacle ? -std::numeric_limits<double>::infinity()
                                                         : config.query.max_distance;
}

std::string broken_agreement(const ProximityArray& message, const std::vector<bool>& counts,
                             double min_distance, double scale) {
  Check check("the summary: ");
  const double least = ist::min_distance(message, counts);
  check.that(std::isnan(min_distance) || min_distance <= least,
             "min_distance must not be above a link's lower_bound", min_distance);
  check.that(scale >= 0.0 && scale <= 1.0, "the scale has to be from 0 to 1", scale);
  check.that(scale == 0.0 || min_distance > 0.0,
             "the scale has to be 0 where min_distance is not known or not above 0", scale);
  return check.broken();
}

std::string broken_invariant(const ProximityArray& message, const InvariantInput& input) {
  Check check("the message: ");
  check.that((message.status == ProximityArray::OK) == message.status_text.empty(),
             "status_text has to be empty where the status is OK, and only there",
             "'" + message.status_text + "'");
  check.that(message.status <= ProximityArray::LOADING, "the status has to be one of the constants",
             int{message.status});
  check.that(message.header.stamp.toSec() <= input.now.toSec() + kClockResolution + kRounding,
             "header.stamp must not be in the future", message.header.stamp);
  check.that(message.computation_time >= 0.0, "computation_time must not be negative",
             message.computation_time);
  const bool lacks_clouds =
      message.status == ProximityArray::NO_CLOUD || message.status == ProximityArray::STALE_CLOUD;
  check.that(!lacks_clouds || !knows_any(message),
             "links have to be UNKNOWN where the status is NO_CLOUD or STALE_CLOUD",
             int{message.status});
  check.that(!knows_any(message) || has_voucher(message),
             "a source that is no memory has to be OK where links are known", "none");
  if (!check.broken().empty()) return check.broken();
  for (const LinkMessage& link : message.links) {
    std::string broken = check_link(link, input);
    if (!broken.empty()) return broken;
  }
  return "";
}

void assert_invariants(const ProximityArray& message, const InvariantInput& input) {
#ifndef NDEBUG
  end_if_broken(broken_invariant(message, input), message);
#else
  (void)message;
  (void)input;
#endif
}

void assert_agreement(const ProximityArray& message, const std::vector<bool>& counts,
                      double min_distance, double scale) {
#ifndef NDEBUG
  end_if_broken(broken_agreement(message, counts, min_distance, scale), message);
#else
  (void)message;
  (void)counts;
  (void)min_distance;
  (void)scale;
#endif
}

}  // namespace ist
