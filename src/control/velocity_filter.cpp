#include "ist_proximity/control/velocity_filter.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "control/nearest_velocity.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;
// [m/s, rad/s] What an answer may exceed a bound by: rounding.
constexpr double kNegligible = 1e-9;

void check(bool holds, const char* name, std::size_t joint, double value, const char* allowed) {
  if (holds) return;
  throw std::invalid_argument(std::string("the ") + name + " of joint " + std::to_string(joint) +
                              " is " + std::to_string(value) + "; it must be " + allowed);
}

void check_size(const std::vector<double>& values, const char* name, std::size_t joints) {
  if (values.size() == joints) return;
  throw std::invalid_argument(std::string(name) + " has " + std::to_string(values.size()) +
                              " numbers; it must have one for each of the " +
                              std::to_string(joints) + " joints");
}

bool is_finite(Span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

// Whether numbers and signs are those that ConstraintRows states.
bool can_be_used(const ConstraintRows& rows, Eigen::Index joints) {
  const auto count = static_cast<Eigen::Index>(rows.count);
  const bool fits = rows.is_complete && rows.horizon > 0.0 && rows.horizon < kInfinity &&
                    rows.G.cols() == joints && rows.sweep.cols() == joints &&
                    rows.G.rows() >= count && rows.sweep.rows() >= count &&
                    rows.h.size() >= count && rows.sweep_limit.size() >= count;
  if (!fits) return false;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (std::isnan(rows.h[i]) || rows.h[i] == -kInfinity || !(rows.sweep_limit[i] >= 0.0))
      return false;
    for (Eigen::Index k = 0; k < joints; ++k) {
      const double sweep = rows.sweep(i, k);
      if (!std::isfinite(rows.G(i, k)) || !(sweep >= 0.0 && sweep < kInfinity)) return false;
    }
  }
  return true;
}

// The factors of a command that meet bounds: from `least` to `most`.
struct Factors {
  double least = 0.0, most = 1.0;
  // Keeps those with slope * factor <= limit.
  void keep(double slope, double limit) {
    if (slope > 0.0) {
      most = std::min(most, limit / slope);
    } else if (slope < 0.0) {
      least = std::max(least, limit / slope);
    } else if (!(slope == 0.0 && limit >= 0.0)) {
      most = -1.0;  // of NaN too, where a sum is too large for a number
    }
  }
};

}  // namespace

JointLimits joint_limits(const Kinematics& kinematics, double speed) {
  JointLimits limits;
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    if (!joint.is_free()) continue;
    limits.speed.push_back(std::min(speed, joint.speed));
    limits.lower.push_back(joint.lower);
    limits.upper.push_back(joint.upper);
  }
  return limits;
}

struct VelocityFilter::Impl {
  Impl(JointLimits given, std::vector<double> given_weights, double given_period)
      : limits(std::move(given)),
        period(given_period),
        joints(static_cast<Eigen::Index>(limits.speed.size())),
        solver(joints) {
    const std::size_t count = limits.speed.size();
    if (limits.lower.empty()) limits.lower.assign(count, -kInfinity);
    if (limits.upper.empty()) limits.upper.assign(count, kInfinity);
    if (limits.acceleration.empty()) limits.acceleration.assign(count, kInfinity);
    if (given_weights.empty()) given_weights.assign(count, 1.0);
    check_size(limits.lower, "lower", count);
    check_size(limits.upper, "upper", count);
    check_size(limits.acceleration, "acceleration", count);
    check_size(given_weights, "weights", count);
    for (std::size_t k = 0; k < count; ++k) {
      check(limits.speed[k] > 0.0, "speed limit", k, limits.speed[k], "more than 0");
      check(limits.acceleration[k] > 0.0, "acceleration limit", k, limits.acceleration[k],
            "more than 0");
      check(limits.upper[k] >= limits.lower[k], "upper limit", k, limits.upper[k],
            "no less than the lower one");
      check(given_weights[k] > 0.0 && given_weights[k] < kInfinity, "weight", k, given_weights[k],
            "more than 0 and finite");
    }
    if (!(period > 0.0 && period < kInfinity)) {
      throw std::invalid_argument("period is " + std::to_string(period) +
                                  " s; it must be more than 0 s");
    }
    weights = Eigen::Map<const Eigen::VectorXd>(given_weights.data(), joints);
    for (Eigen::VectorXd* vector : {&lower, &upper, &target, &given_velocity, &x}) {
      vector->setZero(joints);
    }
    answer.velocity.resize(count, 0.0);
    answer.rows.reserve(count + 1);
    answer.joints.reserve(count + 1);
  }

  // Bounds of velocities by speed and position limits.
  void bound_joints(Span<const double> q, Span<const double> moved, double horizon) {
    for (Eigen::Index k = 0; k < joints; ++k) {
      const auto j = static_cast<std::size_t>(k);
      const double way = moved.empty() ? 0.0 : moved[j];
      const double lowest = q[j] + std::min(way, 0.0), highest = q[j] + std::max(way, 0.0);
      const double down = std::min((limits.lower[j] - lowest) / horizon, 0.0);
      const double up = std::max((limits.upper[j] - highest) / horizon, 0.0);
      lower[k] = std::max(-limits.speed[j], down);
      upper[k] = std::min(limits.speed[j], up);
    }
  }

  // The same with acceleration limits; false where those leave nothing.
  bool bound_accelerations() {
    bool is_left = true;
    for (Eigen::Index k = 0; k < joints; ++k) {
      const double change = limits.acceleration[static_cast<std::size_t>(k)] * period;
      lower[k] = std::max(lower[k], given_velocity[k] - change);
      upper[k] = std::min(upper[k], given_velocity[k] + change);
      if (lower[k] <= upper[k]) continue;
      is_left = false;
      answer.joints.push_back(static_cast<std::size_t>(k));
    }
    return is_left;
  }

  Factors factors(const ConstraintRows& rows) const {
    Factors factors;
    for (Eigen::Index k = 0; k < joints; ++k) {
      factors.keep(target[k], upper[k]);
      factors.keep(-target[k], -lower[k]);
    }
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows.count); ++i) {
      double approach = 0.0, sweep = 0.0;
      for (Eigen::Index k = 0; k < joints; ++k) {
        approach += rows.G(i, k) * target[k];
        sweep += rows.sweep(i, k) * std::abs(target[k]);
      }
      factors.keep(approach, std::max(rows.h[i], 0.0));  // 0 is no retreat that is asked for
      factors.keep(sweep, rows.sweep_limit[i]);
    }
    return factors;
  }

  // Makes 0 of what is as good as 0, for joints that must stand.
  void hold_still(const ConstraintRows& rows) {
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows.count); ++i) {
      if (rows.sweep_limit[i] > 0.0) continue;
      for (Eigen::Index k = 0; k < joints; ++k) {
        if (rows.sweep(i, k) > 0.0 && std::abs(x[k]) < kNegligible) x[k] = 0.0;
      }
    }
  }

  // Whether the velocity x meets the rows, to the rounding of each row's own sum: a joint that is
  // as fast as numbers are excuses no row that it is not in. A sum that is too large for a number
  // meets none.
  bool is_met(const ConstraintRows& rows) const {
    if (!x.allFinite()) return false;
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows.count); ++i) {
      double approach = 0.0, sum = 0.0, sweep = 0.0;
      for (Eigen::Index k = 0; k < joints; ++k) {
        approach += rows.G(i, k) * x[k];
        sum += std::abs(rows.G(i, k) * x[k]);
        sweep += rows.sweep(i, k) * std::abs(x[k]);
      }
      if (!(std::isfinite(sum) && std::isfinite(sweep) &&
            approach <= rows.h[i] + kNegligible * (1.0 + sum) &&
            sweep <= rows.sweep_limit[i] + kNegligible * (1.0 + sweep))) {
        return false;
      }
    }
    return true;
  }

  void tell_active() {
    for (const ActiveBound& bound : solver.active()) {
      const auto index = static_cast<std::size_t>(bound.index);
      const bool is_joint =
          bound.kind == ActiveBound::Kind::kUpper || bound.kind == ActiveBound::Kind::kLower;
      (is_joint ? answer.joints : answer.rows).push_back(index);
    }
  }

  // The solver neglects the limits of a joint beside one that is many times as fast: such joints
  // are told where nothing else is.
  void tell_held() {
    if (!answer.rows.empty() || !answer.joints.empty()) return;
    for (Eigen::Index k = 0; k < joints; ++k) {
      if (x[k] != target[k]) answer.joints.push_back(static_cast<std::size_t>(k));
    }
  }

  void give(FilterStatus status, FilterReason reason, double factor) {
    answer.status = status;
    answer.reason = reason;
    if (status == FilterStatus::kScaled) {
      x = factor * target;
    } else if (status != FilterStatus::kFree && status != FilterStatus::kLimited) {
      x.setZero();
    }
    given_velocity = x;
    Eigen::Map<Eigen::VectorXd>(answer.velocity.data(), joints) = x;
  }

  void scale(FilterReason reason) {
    give(answer.scale > 0.0 ? FilterStatus::kScaled : FilterStatus::kStopped, reason, answer.scale);
  }

  void run(Span<const double> command, Span<const double> q, const ConstraintRows& rows,
           double time_limit, Span<const double> moved) {
    const Clock::time_point end =
        time_limit > 0.0 && time_limit < 1e6
            ? Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                 std::chrono::duration<double>(time_limit))
            : Clock::time_point::max();
    answer.rows.clear();
    answer.joints.clear();
    answer.iterations = 0;
    answer.scale = 0.0;
    const auto count = static_cast<std::size_t>(joints);
    const auto fault = [&](FilterReason reason) { give(FilterStatus::kFault, reason, 0.0); };
    if (command.size() != count || !is_finite(command)) return fault(FilterReason::kCommand);
    if (q.size() != count || !is_finite(q)) return fault(FilterReason::kPositions);
    if (!moved.empty() && (moved.size() != count || !is_finite(moved))) {
      return fault(FilterReason::kPositions);
    }
    if (!can_be_used(rows, joints)) return fault(FilterReason::kRows);
    target = Eigen::Map<const Eigen::VectorXd>(command.data(), joints);
    bound_joints(q, moved, rows.horizon);
    const Factors allowed = factors(rows);
    if (allowed.least <= allowed.most) answer.scale = std::max(allowed.most, 0.0);
    if (!bound_accelerations()) return scale(FilterReason::kContradiction);
    const auto outcome = solver.solve(rows, lower, upper, weights, target, end, &x);
    answer.iterations = solver.iterations();
    tell_active();
    if (outcome == NearestVelocity::Outcome::kContradiction) {
      return scale(FilterReason::kContradiction);
    }
    x = x.cwiseMax(lower).cwiseMin(upper);
    hold_still(rows);
    if (outcome == NearestVelocity::Outcome::kOutOfTime || !is_met(rows)) {
      return scale(FilterReason::kTime);
    }
    tell_held();
    const bool is_free = answer.rows.empty() && answer.joints.empty() && x == target;
    give(is_free ? FilterStatus::kFree : FilterStatus::kLimited, FilterReason::kNone, 1.0);
  }

  JointLimits limits;
  double period;
  Eigen::Index joints;
  NearestVelocity solver;
  Eigen::VectorXd weights, lower, upper, target, x;
  Eigen::VectorXd given_velocity;  ///< of the last answer
  FilterAnswer answer;
};

VelocityFilter::VelocityFilter(JointLimits limits, std::vector<double> weights, double period)
    : impl_(std::make_unique<Impl>(std::move(limits), std::move(weights), period)) {}
VelocityFilter::~VelocityFilter() = default;
VelocityFilter::VelocityFilter(VelocityFilter&&) noexcept = default;
VelocityFilter& VelocityFilter::operator=(VelocityFilter&&) noexcept = default;

const FilterAnswer& VelocityFilter::run(Span<const double> command, Span<const double> q,
                                        const ConstraintRows& rows, double time_limit,
                                        Span<const double> moved) {
  impl_->run(command, q, rows, time_limit, moved);
  return impl_->answer;
}

void VelocityFilter::reset() { impl_->given_velocity.setZero(); }

}  // namespace ist
