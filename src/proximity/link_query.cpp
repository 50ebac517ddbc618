#include "proximity/link_query.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/relative_pose.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Posing a centre takes seven roundings, a distance five more, each of 2^-24 of the numbers
// involved; this is above their sum.
constexpr double kFloatError = 1e-6;
// A stored point is within half a unit in the last place of the measured one, in each coordinate.
constexpr double kPointError = 1.1e-7;

// Directions this close [rad] serve as one: at 5 cm aside that makes 0.5 mm.
constexpr double kSameAim = 0.01;
constexpr std::uint64_t kPairsBeforeAim = 8;
// So many steps ahead are proven, of a link that need only be known not to be nearest.
constexpr double kStepsAhead = 8.0;
// Planes may be this much [m] too far.
constexpr double kSupportSlack = 1e-5;
// What a point's own distance may take of the tolerance.
constexpr double kPointShare = 0.25;

}  // namespace

Deadline::Deadline(double seconds) : limited_(seconds > 0.0) {
  if (!limited_) return;
  end_ = std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(
             std::chrono::duration<double>(std::min(seconds, 1e6)));
}

bool Deadline::passed() {
  if (limited_ && !passed_) passed_ = std::chrono::steady_clock::now() >= end_;
  return passed_;
}

std::uint64_t LinkQuery::build_id(const CloudSnapshot& cloud, Part part) {
  if (part == Part::kPoints) return cloud.index.build_id();
  return cloud.boxes ? cloud.boxes->build_id() : 0;
}

void LinkQuery::start(const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, std::uint64_t seen,
                      const QueryConfig& config) {
  start_cold(X_FL, seen, config, kInfinity);
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    for (const Part part : {Part::kPoints, Part::kBoxes}) {
      if (last_build_id_ == 0 || build_id(*clouds[i], part) != last_build_id_) continue;
      if (!enter(*clouds[i], static_cast<std::int32_t>(i), part)) continue;
      // What was the surface's nearest point to it is no farther now than the two are apart.
      const double apart = part == Part::kPoints
                               ? (X_LO_ * point_O(last_tile_, last_lane_) - last_witness_L_).norm()
                               : kInfinity;
      consider(last_tile_, last_lane_, false, a_little_more(apart), aim_L_);
    }
  }
}

void LinkQuery::start_cold(const Eigen::Isometry3d& X_FL, std::uint64_t seen,
                           const QueryConfig& config, double nearest) {
  X_FL_ = X_FL;
  seen_ = seen;
  config_ = config;
  others_ = nearest;
  nearest_ = Nearest{};
  nearest_.exact.distance = kInfinity;
  promised_ = evaluated_ = kInfinity;
  complete_ = false;
  ++epoch_;
  // Until something is proven: no point is deeper in the link than its bounding sphere's radius.
  dropped_ = -link_->tree.radius();
  rounding_ = reach_ = 0.0;
  region_ = kInfinity;
}

// How near to the link what lies beyond a region may be.
double LinkQuery::to_region(const RegionOfInterest& region) const {
  const double from_center = (X_FL_ * link_->tree.center() - region.center_F).norm();
  return std::max(region.radius - from_center, 0.0) - link_->tree.radius();
}

bool LinkQuery::enter(const CloudSnapshot& cloud, std::int32_t index, Part part) {
  index_ = part == Part::kPoints ? &cloud.index.bvh() : nullptr;
  boxes_ = part == Part::kBoxes && cloud.boxes ? &cloud.boxes->bvh() : nullptr;
  if (part == Part::kPoints ? index_->empty() : boxes_ == nullptr || boxes_->empty()) return false;
  cloud_ = index;
  if (boxes_ != nullptr) {
    X_FO_ = cloud.X_FM * Eigen::Translation3d(boxes_->origin());
  } else {
    X_FO_ = index_->X_FO();
  }
  X_OL_ = relative_pose(X_FO_, X_FL_);
  X_LO_ = X_OL_.inverse();
  const double reach = X_OL_.translation().cwiseAbs().maxCoeff() + link_->tree.center().norm() +
                       link_->tree.radius();
  reach_ = std::max(reach_, reach);
  rounding_ = std::max(rounding_, kFloatError * (reach + config_.max_distance + config_.margin));
  return true;
}

Eigen::Vector3d LinkQuery::point_O(std::int32_t tile, int lane) const {
  PointTile room;
  return index_->tile(static_cast<std::size_t>(tile), &room).point(lane);
}

double LinkQuery::wanted_below(double distance) const {
  const double width = std::max(config_.tolerance, config_.relative_tolerance * distance);
  // Whether any point is inside is always decided, however wide the tolerance.
  return distance > 0.0 ? std::max(distance - width, 0.0) : distance - config_.tolerance;
}

double LinkQuery::threshold() const {
  const double distance = std::min({nearest_.exact.distance, others_, promised_});
  return distance > range() ? range() : wanted_below(distance);
}

void LinkQuery::consider(std::int32_t tile, int lane, bool is_outside, double below,
                         const Eigen::Vector3d& toward) {
  if (boxes_ != nullptr) return consider_box(tile, lane, is_outside);
  const Eigen::Vector3d p_O = point_O(tile, lane), p_L = X_LO_ * p_O;
  const std::uint64_t index = index_->build_id();
  const std::uint32_t key = key_of(tile, lane);
  if (is_outside) {
    const double known = known_.at(index, KnownDistances::Kind::kOutside, key, p_L);
    if (known >= threshold()) return drop(known);
  } else {
    is_outside = link_->tree.cover_distance_exceeds(p_L, link_->tree.interior_gap());
  }
  if (statistics_ != nullptr) ++statistics_->exact_evaluations;
  const double limit = std::min({nearest_.exact.distance, others_, range() + rounding_, below});
  if (!is_outside) return take(link_->solid.signed_distance(p_L), p_L, p_O, tile, lane);
  double floor;
  const SignedDistance exact =
      link_->solid.distance_outside(p_L, limit, toward, kPointShare * config_.tolerance, &floor);
  known_.keep(index, KnownDistances::Kind::kOutside, key, p_L, floor);
  if (floor < exact.distance) evaluated_ = std::min(evaluated_, floor);
  take(exact, p_L, p_O, tile, lane);
}

void LinkQuery::take(const SignedDistance& exact, const Eigen::Vector3d& p_L,
                     const Eigen::Vector3d& p_O, std::int32_t tile, int lane) {
  // A point out of range is no answer, though a bound.
  if (!(exact.distance < nearest_.exact.distance)) return;
  nearest_.exact = exact;
  nearest_.p_L = p_L;
  nearest_.p_F = X_FO_ * p_O;
  nearest_.cloud = cloud_;
  nearest_.tile = tile;
  nearest_.lane = lane;
  nearest_.part = boxes_ != nullptr ? Part::kBoxes : Part::kPoints;
  if (traversal_ != nullptr) {
    traversal_->threshold = std::min(traversal_->threshold, round_up(threshold() + rounding_));
    aim_later(traversal_);
  }
}

// Planes across the way to the nearest point, moved to where the link and its parts end. If the
// link is convex there, its plane touches the witness, and what lies beyond the nearest point's own
// plane is farther. They belong to the link and stay from query to query; new ones cost as much as
// some dozens of pairs, so a descent has to last, without a nearer point, before they are made.
bool LinkQuery::needs_aim() const {
  if (!(nearest_.exact.distance > 0.0) || nearest_.exact.distance == kInfinity) return false;
  return (nearest_.exact.normal - aim_L_).squaredNorm() > kSameAim * kSameAim;
}

void LinkQuery::aim_later(Traversal* traversal) const {
  if (needs_aim()) traversal->aim_after = traversal->node_pairs + kPairsBeforeAim;
}

void LinkQuery::on_aim(void* context) {
  auto* self = static_cast<LinkQuery*>(context);
  self->keep_promise();
  if (!self->needs_aim()) return;
  self->aim_L_ = self->nearest_.exact.normal;
  const Eigen::Vector3f n = self->aim_L_.cast<float>();
  const double reached = self->aim_L_.dot(self->nearest_.exact.witness);
  const double most = self->link_->solid.support(self->aim_L_, kSupportSlack, reached);
  self->supports_.aim(n.data(), round_up(most));
  self->set_planes(self->traversal_);
}

void LinkQuery::set_planes(Traversal* traversal) const {
  if (aim_L_.isZero()) return;
  const Eigen::Vector3d n_O = X_OL_.linear() * aim_L_;
  for (int axis = 0; axis < 3; ++axis) traversal->normal[axis] = static_cast<float>(n_O[axis]);
  traversal->offset = round_up(n_O.dot(X_OL_.translation()) + rounding_);
}

void LinkQuery::on_nearer(void* context) {
  auto* self = static_cast<LinkQuery*>(context);
  Traversal* traversal = self->traversal_;
  self->promised_ = std::max(static_cast<double>(traversal->inner_distance) + self->rounding_, 0.0);
  traversal->threshold =
      std::min(traversal->threshold, round_up(self->threshold() + self->rounding_));
  traversal->aim_after = traversal->node_pairs + kPairsBeforeAim;
}

bool LinkQuery::on_expired(void* context) {
  return static_cast<LinkQuery*>(context)->deadline_->passed();
}

// Without a last answer: the inner spheres find a point that is near, its exact
// distance is a bound.
void LinkQuery::find_first(Traversal* traversal) {
  Traversal inner = *traversal;
  inner.expired = nullptr;
  inner.aim_after = kNever;
  inner.front = nullptr;
  descend_inner(&inner);
  if (inner.inner_tile >= 0) consider(inner.inner_tile, inner.inner_lane, false, kInfinity, aim_L_);
  if (inner.inner_distance < 0.0F && boxes_ != nullptr) {
    take_sphere(inner.inner_leaf, inner.inner_tile, inner.inner_lane);
  }
  traversal->node_pairs += inner.node_pairs;
  traversal->leaf_pairs += inner.leaf_pairs;
}

bool LinkQuery::refine(SnapshotSpan clouds, Deadline* deadline, QueryStatistics* statistics) {
  region_ = kInfinity;
  for (const CloudSnapshot* cloud : clouds) {
    region_ = std::min(region_, to_region(cloud->region));
  }
  if (sees_all() && is_settled()) return true;
  if (deadline->passed()) return false;
  deadline_ = deadline;
  statistics_ = statistics;
  dropped_ = beyond_ = kInfinity;
  look_ahead();
  // With holes, cells bound little: see Solid::distance_floor.
  cells_left_ = link_->solid.is_closed() ? kMaxCells : kMaxCells / 8;
  bool stopped = false;
  if (!sees_all()) {
    drop(region_);
    ++statistics->outside_region;
  }
  for (std::size_t i = 0; i < clouds.size() && !stopped; ++i) {
    for (const Part part : {Part::kPoints, Part::kBoxes}) {
      if (stopped || !enter(*clouds[i], static_cast<std::int32_t>(i), part)) continue;
      ++epoch_;  // keys are per index
      stopped = search(deadline);
    }
  }
  if (stopped) drop(-link_->tree.radius());  // clouds that were not reached
  complete_ = !stopped;
  if (complete_) keep_bound();
  return complete_;
}

// Whether what was proven at another pose is enough at this one.
bool LinkQuery::is_settled() {
  const double carried = carried_.at(seen_, X_FL_);
  if (!(carried >= threshold() - kRounding) || !(nearest_.exact.distance > 0.0)) return false;
  dropped_ = carried;
  reach_ = std::max(reach_, proven_reach_ + carried_.motion(seen_, X_FL_));
  complete_ = true;
  return true;
}

// What need only be known to be farther than another link: a little more, proven now, spares the
// queries to come as many steps as long as the last ones.
void LinkQuery::look_ahead() {
  if (others_ == kInfinity) return;
  const double ahead = kStepsAhead * carried_.motion(seen_, X_FL_);
  if (ahead < others_) others_ += ahead;
}

void LinkQuery::keep_bound() {
  double bound = least_bound();
  // Float loses more, the farther.
  if (bound > range()) bound -= kFloatError * (bound - range());
  proven_reach_ = reach_;
  carried_.prove(seen_, X_FL_, bound, std::min(beyond_, dropped_));
}

Traversal LinkQuery::make_traversal() {
  Traversal traversal;
  traversal.sphere_nodes = link_->tree.nodes().data();
  traversal.sphere_leaves = link_->tree.leaves().data();
  if (boxes_ != nullptr) {
    traversal.box_nodes = boxes_->nodes().data();
    traversal.box_tiles = boxes_->tiles().data();
    traversal.box_root = boxes_->root();
  } else {
    traversal.box_nodes = index_->nodes().data();
    traversal.points = index_;
    traversal.box_root = index_->root();
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      traversal.R_OL[3 * row + column] = static_cast<float>(X_OL_.linear()(row, column));
    }
    traversal.p_OL[row] = static_cast<float>(X_OL_.translation()[row]);
  }
  traversal.rounding = round_up(rounding_);
  traversal.supports = &supports_;
  set_planes(&traversal);
  traversal.aim = &LinkQuery::on_aim;
  traversal.threshold = round_up(threshold() + rounding_);
  traversal.interior = round_up(link_->tree.interior_gap() + rounding_);
  traversal.candidate = &LinkQuery::on_candidate;
  traversal.expired = &LinkQuery::on_expired;
  traversal.context = this;
  return traversal;
}

void LinkQuery::descend(Traversal* traversal) {
  traversal->inner_distance = traversal->threshold;
  aim_later(traversal);
  descend_exact(traversal);
  if (!traversal->stopped) return evaluate_waiting();
  keep_promise();  // late: only what an answer needs
  for (std::size_t i = 0; i < waiting_count_; ++i) {
    traversal->dropped = std::min(traversal->dropped, waiting_[i].bound);
  }
  waiting_count_ = 0;
}

// From where the last descent of this index ended, if that can be.
void LinkQuery::go_on(Traversal* traversal) {
  const std::uint64_t index = boxes_ != nullptr ? boxes_->build_id() : index_->build_id();
  traversal->front = fronts_.of(index);
  if (traversal->front != nullptr) traversal->front->go_to(index, X_OL_, extent_);
}

// The index at work. True: the deadline passed.
bool LinkQuery::search(Deadline* deadline) {
  Traversal traversal = make_traversal();
  traversal_ = &traversal;
  if (boxes_ != nullptr) {
    if (std::min(nearest_.exact.distance, others_) == kInfinity) find_first(&traversal);
  } else {
    traversal.nearer = &LinkQuery::on_nearer;
  }
  go_on(&traversal);
  is_broken_ = false;
  const double dropped_before = dropped_;
  descend(&traversal);
  if (is_broken_ && !traversal.stopped) {
    Traversal again = make_traversal();
    again.node_pairs = traversal.node_pairs;
    again.leaf_pairs = traversal.leaf_pairs;
    again.may_be_inside = traversal.may_be_inside;
    go_on(&again);
    traversal = again;
    dropped_ = dropped_before;
    ++epoch_;
    descend(&traversal);
  }
  traversal_ = nullptr;
  statistics_->node_pairs += traversal.node_pairs;
  statistics_->leaf_pairs += traversal.leaf_pairs;
  drop(static_cast<double>(traversal.dropped) - rounding_);
  bool stopped = traversal.stopped;
  if (traversal.may_be_inside) beyond_ = -kInfinity;
  if (traversal.may_be_inside && !stopped) {
    boxes_ != nullptr ? find_overlap(deadline) : find_depth(deadline);
  }
  stopped = stopped || deadline->passed();
  // A pair that was left may hold a point inside.
  if (stopped && dropped_ <= link_->tree.interior_gap() + rounding_) drop(-link_->tree.radius());
  return stopped;
}

double LinkQuery::proven() const {
  const double bound = least_bound();
  if (bound == kInfinity) return bound;
  return bound - kPointError * (reach_ + std::abs(bound)) - config_.margin;
}

void LinkQuery::answer(SnapshotSpan clouds, LinkProximity* result) {
  result->reset();
  statistics_ = nullptr;
  last_build_id_ = 0;
  if (nearest_.exact.distance > range()) {
    if (!complete_ || !sees_all()) return;  // UNKNOWN: nothing measured, and not all was seen
    result->state = LinkState::kClear;
    result->distance = kInfinity;
    result->lower_bound = config_.max_distance;
    return;
  }
  const Nearest& nearest = nearest_;
  // Points that could be nearer have coordinates no larger than this one's bound.
  const double point_error = kPointError * (reach_ + std::abs(nearest.exact.distance));
  const CloudSnapshot& cloud = *clouds[static_cast<std::size_t>(nearest.cloud)];
  const auto tile = static_cast<std::size_t>(nearest.tile);
  last_build_id_ = build_id(cloud, nearest.part);
  last_tile_ = nearest.tile;
  last_lane_ = nearest.lane;
  last_witness_L_ = nearest.exact.witness;
  result->state = nearest.exact.distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  result->distance = nearest.exact.distance;
  result->lower_bound = least_bound() - point_error - config_.margin;
  result->p_LCl = nearest.exact.witness;
  result->p_FCl = X_FL_ * nearest.exact.witness;
  result->p_FCo = nearest.p_F;
  result->direction = -(X_FL_.linear() * nearest.exact.normal);
  result->source = nearest.cloud;
  PointTile room;
  result->point = nearest.part == Part::kBoxes
                      ? cloud.boxes->bvh().tiles()[tile].id[nearest.lane]
                      : cloud.index.bvh().tile(tile, &room).id[nearest.lane];
}

}  // namespace ist
