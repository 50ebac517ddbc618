// The clearance of a robot's links along the pieces of a trajectory.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ist_proximity/proximity/time_of_impact.h"
#include "proximity/time_of_impact_impl.h"

namespace ist {
namespace {

constexpr double kTouch = 1e-4;            // [m] a bound below it is contact, of what stands
constexpr double kLeastStep = 2e-3;        // [m] between two distances, while there is as much room
constexpr double kShareOfDistance = 0.25;  // the same, of the distance
constexpr int kMaxSteps = 4000;
// Tolerance of the next distance: as a share of the last one, and in [m] at the first.
constexpr double kRelativeTolerance = 0.1, kFirstTolerance = 0.01;
// [s] Where obstacles come nearer, nothing need be known better than by what they come in this
// time, and no first distance better than in the other.
constexpr double kInTime = 2e-3, kFirstInTime = 0.02;

// A link on its way.
struct Advance {
  std::size_t link;
  LinkClearance* found;
  bool is_over = false;  // in contact, not known, or stopped
  // [m] It may come so much nearer to the obstacles before it is measured again; below 0: at once.
  double allowance = -1.0;
  double least = kInfinity;            // [m] of the bounds that were measured
  double tolerance = kFirstTolerance;  // [m]
};

// [s] The robot stays at its end for so long; at a time above 1 s, for this share of the time.
constexpr double kEnd = 1e-9;

// Stays where a trajectory ends, from `time` on.
StraightPieces end_of(const StraightPieces& pieces, double time) {
  const std::vector<double>& end = pieces.positions.back();
  return {{time, time + kEnd * std::max(1.0, std::abs(time))},
          {end, end},
          {std::vector<double>(end.size(), 0.0)}};
}

bool are_bounded(const std::vector<double>& deviations) {
  return std::all_of(deviations.begin(), deviations.end(),
                     [](double one) { return one >= 0.0 && one <= kLargestMotion; });
}

}  // namespace

/// A piece of the trajectory, straight in joint space.
class TimeOfImpact::Impl::Piece {
 public:
  /// @param begin   [s] of the trajectory
  /// @param from    [s] of the whole trajectory, from which obstacles come nearer
  Piece(Impl* impl, double begin, double from, const std::vector<double>& deviation,
        const Eigen::Isometry3d& X_FR, const ImpactObstacles& obstacles, double obstacle_speed,
        double obstacle_age)
      : impl_(*impl),
        begin_(begin),
        from_(from),
        deviation_(deviation),
        X_FR_(X_FR),
        obstacles_(obstacles),
        obstacle_speed_(obstacle_speed),
        obstacle_age_(obstacle_age) {}

  // Goes on to the end of the piece, if nothing ends the advance before.
  void run(Advance* advance) {
    const MotionBound motion = impl_.bound(advance->link, obstacles_);
    const MotionBound off = impl_.moved.bound_deviation(
        *impl_.moved.forward().body(advance->link), impl_.model->links[advance->link].tree.center(),
        impl_.radius(advance->link, obstacles_), deviation_);
    const double duration = impl_.moved.duration();
    double time = std::max(from_ - begin_, 0.0);
    while (true) {
      place(time);
      const double speed = impl_.speed(motion) + obstacle_speed_;
      // [m] How far the link may be from the straight motion.
      const double tube = off.speed(impl_.moved.forward().bodies().X_FB) + carried_tube();
      const double room = advance->allowance - tube;
      const double stays = room < 0.0 ? 0.0 : time_within(room, speed);
      if (time + stays >= duration) {
        advance->allowance -= (1.0 + 1e-9) * speed * (duration - time);
        return;
      }
      time += stays;
      place(time);
      if (!take(measure(advance, time, tube), time, tube, advance)) return;
    }
  }

 private:
  void place(double time) {
    if (time == placed_) return;
    impl_.place(time, X_FR_);
    placed_ = time;
  }

  // [m] The same for the objects that the robot carries.
  double carried_tube() const {
    double largest = 0.0;
    for (const CarriedWorlds::Frame& frame : impl_.carried.frames()) {
      const MotionBound off =
          impl_.moved.bound_deviation(frame.body, frame.center_B, frame.radius, deviation_);
      largest = std::max(largest, off.speed(impl_.moved.forward().bodies().X_FB));
    }
    return largest;
  }

  // [m] A lower bound of the distance; as good as it gets where the link seems to be in contact.
  double measure(Advance* advance, double time, double tube) {
    const double come = obstacle_speed_ * (obstacle_age_ + begin_ + time - from_);
    impl_.moving[advance->link] = true;
    double distance = impl_.measure(advance->link, obstacles_, advance->tolerance) - come;
    if (distance - tube <= touch_ && advance->tolerance > best_) {
      distance = impl_.measure(advance->link, obstacles_, best_) - come;
    }
    impl_.moving[advance->link] = false;
    ++advance->found->steps;
    return distance;
  }

  // Takes a bound into the result. @returns false where that ends the advance
  bool take(double distance, double time, double tube, Advance* advance) const {
    LinkClearance* found = advance->found;
    // The first one is the best: a contact there is told for the time that was asked for.
    const double now = found->steps == 1 ? std::max(from_, begin_) : begin_ + time;
    if (std::isnan(distance)) {
      const int steps = found->steps;
      *found = LinkClearance();
      found->steps = steps;
      advance->is_over = true;
      return false;
    }
    if (!(distance >= advance->least)) {
      advance->least = distance;
      found->nearest_time = now;
    }
    const bool is_contact = distance - tube <= touch_;
    if (is_contact || found->steps >= kMaxSteps) {
      found->contact_time = now;
      found->converged = is_contact;
      found->lower_bound = std::fmin(found->lower_bound, distance - tube);
      advance->is_over = true;
      return false;
    }
    // This distance need not be known better than those where others were nearer.
    const double step = std::max(kLeastStep + tube, kShareOfDistance * distance);
    advance->allowance = std::max(distance - advance->least, std::min(step, distance));
    const double most = std::max(kFirstTolerance, kFirstInTime * obstacle_speed_);
    advance->tolerance = std::max(std::min(most, kRelativeTolerance * distance), best_);
    found->lower_bound = std::fmin(found->lower_bound, distance - advance->allowance);
    return true;
  }

  Impl& impl_;
  const double begin_, from_;  // [s]
  const std::vector<double>& deviation_;
  const Eigen::Isometry3d& X_FR_;
  const ImpactObstacles& obstacles_;
  const double obstacle_speed_, obstacle_age_;
  const double best_ = kInTime * obstacle_speed_;  // [m] tolerance
  const double touch_ = std::max(kTouch, best_);   // [m] a bound below it is contact
  double placed_ = kNaN;                           // [s] the robot is where it is then
};

void TimeOfImpact::run(const StraightPieces& pieces, double from, const JointPoses& still,
                       const Eigen::Isometry3d& X_FR, const std::vector<bool>& wanted,
                       SnapshotSpan clouds, Span<const PosedWorld* const> worlds,
                       double obstacle_speed, double obstacle_age,
                       std::vector<LinkClearance>* results) {
  Impl& impl = *impl_;
  const std::size_t count = impl.model->links.size();
  results->assign(count, LinkClearance());
  const bool is_whole = wanted.size() == count && !pieces.times.empty() &&
                        pieces.positions.size() == pieces.times.size() &&
                        pieces.deviations.size() + 1 == pieces.times.size();
  if (!is_whole || (!worlds.empty() && !impl.worlds) || !(obstacle_speed >= 0.0) ||
      !(obstacle_age >= 0.0) || !std::isfinite(from)) {
    return;
  }
  if (pieces.times.size() == 1 || pieces.times.back() <= from) {
    const double end = std::max(from, pieces.times.back());
    return run(end_of(pieces, end), end, still, X_FR, wanted, clouds, worlds, obstacle_speed,
               obstacle_age, results);
  }
  std::vector<Advance> advances;
  for (std::size_t i = 0; i < count; ++i) {
    if (wanted[i] && impl.moved.forward().body(i) && impl.model->links[i].usable()) {
      advances.push_back({i, &(*results)[i]});
    }
  }
  const auto all_unknown = [&] { results->assign(count, LinkClearance()); };
  impl.carried.take(worlds, impl.moved.forward().kinematics());
  const ImpactObstacles obstacles{clouds, impl.carried.worlds()};
  for (std::size_t k = 0; k + 1 < pieces.times.size(); ++k) {
    if (pieces.times[k + 1] <= from) continue;
    const JointMotion motion{pieces.positions[k], pieces.positions[k + 1],
                             pieces.times[k + 1] - pieces.times[k]};
    const bool is_known = pieces.deviations[k].size() == pieces.positions[k].size() &&
                          are_bounded(pieces.deviations[k]);
    if (!is_known || !impl.moved.begin(motion, still)) return all_unknown();
    impl.bound_carried();
    Impl::Piece piece(&impl, pieces.times[k], from, pieces.deviations[k], X_FR, obstacles,
                      obstacle_speed, obstacle_age);
    for (Advance& advance : advances) {
      if (!advance.is_over) piece.run(&advance);
    }
  }
  for (Advance& advance : advances) {
    if (!advance.is_over) advance.found->contact_time = kInfinity;
  }
}

}  // namespace ist
