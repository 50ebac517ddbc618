#include "proximity/surface_pair_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <utility>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// The key of a pair of which nothing is proven.
constexpr double kUnproven = -1e-30;

// Float's error in the bounds of boxes, as a share of all coordinates and sizes involved.
constexpr double kBoxRounding = 2e-6;
// [m] The path is measured anew after this length, so that keys keep their digits.
constexpr double kLongestPath = 100.0;
// [m] After a longer jump the front fits no more.
constexpr double kJump = 0.02;
// A query of so many pairs meets ties, such as parallel faces. From then on bounds that are as
// near as the rounding of boxes count as equal.
constexpr int kManyPairs = 4096;
// The plane between the closest points is tried after so many pairs, and when twice as many more
// have been looked at.
constexpr int kFirstPlane = 12;
// A search from a kept front goes on to this part of the tolerance, and to this much more than the
// range [m].
constexpr double kSearchedShare = 0.25, kRangeSlack = 0.01;
// After so many pairs a search is content with the tolerance. Where that comes often, there is no
// slack, and every pose is searched: half of this doubled the time of motions with many ties.
constexpr int kSlackPairs = 8192;

// After so many questions to hulls of nodes of a size, one of so many has to be answered.
constexpr int kHullsAsked = 8, kHullsPerAnswer = 4;

constexpr std::size_t kStackCapacity =
    stack_capacity(2 * SurfaceBvh::kMaxLevels, SurfaceBvh::kWidth);

const ConvexPart& part_of(const SurfaceBvh& bvh, SurfaceBvh::Slot slot) {
  return bvh.parts()[static_cast<std::size_t>(~bvh.child(slot))];
}

// A box of one surface in the frame of the other one.
OrientedBox posed_box(const SurfaceBvh& bvh, SurfaceBvh::Slot slot, const Eigen::Matrix3f& R,
                      const Eigen::Vector3f& p, const Eigen::Vector3f& direction) {
  const SurfaceBvh::Node& node = bvh.node_of(slot);
  const std::size_t k = slot % SurfaceBvh::kWidth;
  const auto column = [k](const float(*rows)[SurfaceBvh::kWidth]) {
    return Eigen::Vector3f(rows[0][k], rows[1][k], rows[2][k]);
  };
  OrientedBox box;
  Eigen::Map<Eigen::Vector3f>(box.center) = R * column(node.center) + p;
  for (int i = 0; i < 3; ++i) {
    Eigen::Map<Eigen::Vector3f>(box.axis[i]) = R * column(node.axis[i]);
    box.half[i] = node.half[i][k];
  }
  Eigen::Map<Eigen::Vector3f>(box.direction) = direction;
  return box;
}

// The part in a slot, in the frame of the other surface; none: the slot holds more than one.
std::optional<ConvexPart> single_part(const SurfaceBvh& bvh, SurfaceBvh::Slot slot,
                                      const Eigen::Isometry3d& X) {
  if (bvh.child(slot) >= 0) return std::nullopt;
  return posed(part_of(bvh, slot), X);
}

// [m] box_bound() of a node's child.
double child_bound(const ConvexPart& part, const SurfaceBvh::Node& node, std::size_t k) {
  const auto column = [k](const float(*rows)[SurfaceBvh::kWidth]) {
    return Eigen::Vector3d(static_cast<double>(rows[0][k]), static_cast<double>(rows[1][k]),
                           static_cast<double>(rows[2][k]));
  };
  Eigen::Matrix3d axes;
  axes << column(node.axis[0]), column(node.axis[1]), column(node.axis[2]);
  return box_bound(part, column(node.center), axes, column(node.half));
}

}  // namespace

// [m] The bound that is left of a key.
inline double SurfacePairSearch::bound_at(double key) const {
  return key < 0.0 ? 0.0 : std::max(key - path() * (1.0 + 1e-14), 0.0);
}

inline bool SurfacePairSearch::is_wanted(double bound) const {
  return bound < prune_bound_ || bound <= 0.0;
}

inline bool SurfacePairSearch::is_leaf(const Pair& pair) const {
  return a_.child(pair.a) < 0 && b_.child(pair.b) < 0;
}

// A number below 0 for boxes that overlap, which orders small ones first: they lead to an
// intersection soonest.
inline double SurfacePairSearch::overlap_order(const Pair& pair) const {
  return -1.0 / (a_.radius(pair.a) + b_.radius(pair.b) + 1e-30);
}

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity)
    : SurfacePairSearch(a, b, capacity, {}, {}) {}

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                                     SurfacePairSearch&& memory)
    : SurfacePairSearch(a, b, capacity, std::move(memory.queue_), std::move(memory.kept_)) {}

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                                     std::vector<Entry> queue, std::vector<Entry> kept)
    : a_(a), b_(b), capacity_(capacity), queue_(std::move(queue)), kept_(std::move(kept)) {
  assert(capacity >= 2 * SurfaceBvh::kWidth);
  queue_.reserve(capacity);
  kept_.reserve(capacity);
  start_anew();
}

void SurfacePairSearch::start_anew() {
  queue_.clear();
  kept_.clear();
  least_kept_ = kInf;
  path_ = moved_ = plane_path_ = plane_bound_ = 0.0;
  if (!a_.empty() && !b_.empty()) {
    keep({kUnproven, SurfaceBvh::kRoot, SurfaceBvh::kRoot, 0});
  }
}

void SurfacePairSearch::move_to(const Eigen::Isometry3d& X_BA, double displacement) {
  X_BA_ = X_BA;
  moved_ = displacement >= 0.0 ? displacement : kInf;
  is_at_reference_ = is_searching_ = has_boxes_ = false;
  const double scale = X_BA.translation().norm() + a_.extent() + b_.extent();
  rounding_ = kBoxRounding * scale;
  exact_rounding_ = 2.0 * kLostInLength * scale;
  closest_ = {};
  if (has_witness_) {
    measure({0.0, witness_a_, witness_b_});
  } else if (!a_.empty() && !b_.empty()) {
    descend();
  }
}

// What boxes are compared with, in float.
void SurfacePairSearch::prepare_boxes() {
  if (has_boxes_) return;
  has_boxes_ = true;
  X_AB_ = X_BA_.inverse();
  R_BA_ = X_BA_.linear().cast<float>();
  p_BA_ = X_BA_.translation().cast<float>();
  R_AB_ = X_AB_.linear().cast<float>();
  p_AB_ = X_AB_.translation().cast<float>();
  set_direction();
}

// What is proven from here on is proven at this pose.
void SurfacePairSearch::set_reference() {
  has_jumped_ = !(moved_ <= kJump);
  if (has_jumped_) {
    start_anew();
  } else {
    path_ += moved_;
    moved_ = 0.0;
    if (path_ > kLongestPath) rebase_path();
  }
  reference_X_BA_ = X_BA_;
  is_at_reference_ = true;
  wants_slack_ = false;
  plane_tried_ = 0.0;
}

void SurfacePairSearch::begin_search() {
  // A front that costs more than to start anew has become too fine for what is near now.
  if (is_new_) cost_of_new_ = looked_at_;
  const bool is_worn = !is_new_ && looked_at_ > cost_of_new_;
  const bool is_crowded = 4 * (queue_.size() + kept_.size()) > 3 * capacity_;
  is_new_ = has_jumped_ || is_worn || is_crowded;
  if (is_new_ && !has_jumped_) start_anew();
  wants_slack_ = !has_jumped_;
  looked_at_ = 0;
  hull_answers_.fill({});
  next_plane_ = kFirstPlane;
  is_searching_ = true;
  prepare_boxes();
  if (has_jumped_) descend();
  update_prune_bound();
  sort_front();
}

// Divides the front into what is wanted and what is not.
void SurfacePairSearch::sort_front() {
  kept_.insert(kept_.end(), queue_.begin(), queue_.end());
  queue_.clear();
  least_kept_ = kInf;
  std::size_t count = 0;
  for (const Entry& entry : kept_) {
    if (is_wanted(bound_at(entry.key))) {
      queue_.push_back(entry);
    } else {
      least_kept_ = std::min(least_kept_, entry.key);
      kept_[count++] = entry;
    }
  }
  kept_.resize(count);
  std::make_heap(queue_.begin(), queue_.end());
}

void SurfacePairSearch::rebase_path() {
  // A key that was below the path by now proves nothing.
  for (std::vector<Entry>* entries : {&queue_, &kept_}) {
    for (Entry& entry : *entries) entry.key = entry.key > path_ ? entry.key - path_ : kUnproven;
  }
  plane_bound_ -= path_ - plane_path_;
  path_ = plane_path_ = 0.0;
}

double SurfacePairSearch::lower_bound() const {
  double key = least_kept_;
  if (!queue_.empty()) key = std::min(key, queue_.front().key);
  return std::max(std::min(std::max(bound_at(key), plane_bound()), closest_.distance), 0.0);
}

double SurfacePairSearch::tolerance_at(double distance) const {
  const double resolved = 1e-12 * distance + 4.0 * exact_rounding_;
  const double share = is_searching_ && wants_slack_ ? kSearchedShare : 1.0;
  const double tolerance =
      std::max({share * goal_.tolerance, share * goal_.relative_tolerance * distance, resolved});
  return looked_at_ > kManyPairs ? std::max(tolerance, 2.0 * rounding_) : tolerance;
}

void SurfacePairSearch::update_prune_bound() {
  const double distance = closest_.distance;
  const double range = goal_.range + (is_searching_ && wants_slack_ ? kRangeSlack : 0.0);
  const double near = std::max(distance - tolerance_at(distance), 0.0);
  prune_bound_ = distance < goal_.range ? near : std::min(std::max(near, goal_.range), range);
}

void SurfacePairSearch::set_direction() {
  Eigen::Vector3d n = closest_.on_p - closest_.on_q;
  if (!(closest_.distance > 1e-9 && closest_.distance < kInf)) {
    const auto middle = [](const SurfaceBvh& bvh) {
      return bvh.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                         : Eigen::Vector3d(bvh.bounds().center());
    };
    n = X_BA_ * middle(a_) - middle(b_);
  }
  const double length = n.norm();
  n_B_ = (length > 0.0 ? Eigen::Vector3d(n / length) : Eigen::Vector3d::UnitZ()).cast<float>();
  n_A_ = R_AB_ * n_B_;
}

// The children of the larger box beside the smaller one: those that are wanted.
// @param children  by bit, 0 for all
SurfacePairSearch::Expansion SurfacePairSearch::expand(const Pair& pair, std::uint8_t children,
                                                       double prune_bound) {
  const std::int32_t child_a = a_.child(pair.a), child_b = b_.child(pair.b);
  const bool of_a = child_b < 0 || (child_a >= 0 && a_.radius(pair.a) >= b_.radius(pair.b));
  alignas(32) float bounds[SurfaceBvh::kWidth];
  const SurfaceBvh::Node& node = of_a ? a_.node(child_a) : b_.node(child_b);
  if (of_a) {
    oriented_box_bounds(node, posed_box(b_, pair.b, R_AB_, p_AB_, n_A_), bounds);
  } else {
    oriented_box_bounds(node, posed_box(a_, pair.a, R_BA_, p_BA_, -n_B_), bounds);
  }
  const std::optional<ConvexPart> part =
      of_a ? single_part(b_, pair.b, X_AB_) : single_part(a_, pair.a, X_BA_);
  const double part_radius = of_a ? b_.radius(pair.b) : a_.radius(pair.a);
  const auto first = static_cast<SurfaceBvh::Slot>((of_a ? child_a : child_b) * SurfaceBvh::kWidth);
  Expansion result;
  result.count = 0;
  result.unwanted = 0;
  result.least_unwanted = kInf;
  for (int k = 0; k < node.count; ++k) {
    const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(k));
    if (children != 0 && (children & bit) == 0) continue;
    double bound = std::max(static_cast<double>(bounds[k]) - rounding_, pair.bound);
    // A part may be much smaller than the box about it, as half of a rectangle is.
    if (part && bound < prune_bound && part_radius > static_cast<double>(node.radius[k])) {
      bound = std::max(bound, child_bound(*part, node, static_cast<std::size_t>(k)) - rounding_);
    }
    if (bound > 0.0 && bound >= prune_bound) {
      result.unwanted = static_cast<std::uint8_t>(result.unwanted | bit);
      result.least_unwanted = std::min(result.least_unwanted, bound);
      continue;
    }
    Pair& child = result.wanted[result.count++];
    child = pair;
    (of_a ? child.a : child.b) = first + static_cast<SurfaceBvh::Slot>(k);
    child.bound = bound > 0.0 ? bound : overlap_order(child);
  }
  return result;
}

// Measures two parts. @returns [m] a lower bound of their distance
double SurfacePairSearch::measure(const Pair& pair) {
  const ConvexDistance found =
      convex_distance(posed(part_of(a_, pair.a), X_BA_), part_of(b_, pair.b));
  if (found.distance < closest_.distance || !has_witness_) {
    closest_ = found;
    witness_a_ = pair.a;
    witness_b_ = pair.b;
    has_witness_ = true;
    if (has_boxes_) set_direction();
    update_prune_bound();
  }
  return std::max(found.lower_bound - exact_rounding_, 0.0);
}

ConvexPart SurfacePairSearch::part_a() const { return posed(part_of(a_, witness_a_), X_BA_); }

const ConvexPart& SurfacePairSearch::part_b() const { return part_of(b_, witness_b_); }

// Finds an upper bound: from the roots on, always the child with the least bound.
void SurfacePairSearch::descend() {
  prepare_boxes();
  Pair pair{-1.0, SurfaceBvh::kRoot, SurfaceBvh::kRoot};
  while (!is_leaf(pair)) {
    const Expansion children = expand(pair, 0, kInf);
    pair = *std::min_element(children.wanted, children.wanted + children.count,
                             [](const Pair& p, const Pair& q) { return p.bound < q.bound; });
    pair.bound = -1e30;
  }
  measure(pair);
}

void SurfacePairSearch::keep(const Entry& entry) {
  kept_.push_back(entry);
  least_kept_ = std::min(least_kept_, entry.key);
}

// The distance of the surfaces along the line through the closest points, if these have changed.
void SurfacePairSearch::prove_by_plane() {
  next_plane_ = 2 * looked_at_ + kFirstPlane;
  if (!(closest_.distance > 1e-9 && closest_.distance < goal_.range)) return;
  if (plane_tried_ == closest_.distance) return;
  plane_tried_ = closest_.distance;
  const Eigen::Vector3d n_B = (closest_.on_p - closest_.on_q) / closest_.distance;
  const Eigen::Vector3d n_A = X_BA_.linear().transpose() * n_B;
  const HullCoreset &hull_a = a_.hull(), &hull_b = b_.hull();
  const double middle = n_B.dot(X_BA_.translation());
  if (!hull_a.empty() && !hull_b.empty()) {
    const double below = n_B.dot(hull_b.point(hull_b.farthest(n_B)));
    const double above = n_A.dot(hull_a.point(hull_a.farthest(-n_A)));
    const double gap = middle + above - below;
    keep_plane(gap - (hull_a.error() + hull_b.error()) * (1.0 + 1e-9) - exact_rounding_);
    // The coresets' hulls are no larger than the surfaces.
    if (is_wanted(gap + exact_rounding_) || !is_wanted(plane_bound())) return;
  }
  keep_plane(middle - a_.support(-n_A) - b_.support(n_B) - exact_rounding_);
}

void SurfacePairSearch::keep_plane(double bound) {
  if (bound < plane_bound()) return;
  plane_bound_ = bound;
  plane_path_ = path();
}

// Tries the plane between the closest parts found last, then that between the hulls, then that
// between the parts nearest to the hulls' closest points. @returns whether that is the answer
bool SurfacePairSearch::prove_by_hulls() {
  if (!has_jumped_ || a_.hull().empty() || b_.hull().empty()) prove_by_plane();
  if (!is_wanted(plane_bound())) return true;
  if (a_.hull().empty() || b_.hull().empty()) return false;
  const double precision = kSearchedShare * tolerance_at(std::min(closest_.distance, goal_.range));
  const HullDistance hulls = hull_distance(a_.hull(), b_.hull(), X_BA_, precision, &hull_support_);
  keep_plane(hulls.lower_bound - exact_rounding_);
  if (!is_wanted(plane_bound())) return true;
  if (!(hulls.lower_bound > 0.0)) return false;
  const SurfaceBvh::Slot on_a = a_.nearest_part(X_BA_.inverse() * hulls.on_a, precision);
  const SurfaceBvh::Slot on_b = b_.nearest_part(hulls.on_b, precision);
  measure({0.0, on_a, on_b});
  if (is_wanted(plane_bound())) prove_by_plane();
  return !is_wanted(plane_bound());
}

SurfacePairSearch::Start SurfacePairSearch::start(int* steps) {
  if (closest_.distance <= 0.0 || !is_wanted(lower_bound())) return Start::kAnswered;
  if (!is_at_reference_) {
    if (*steps <= 0) return Start::kNoSteps;
    --*steps;
    set_reference();
    if (prove_by_hulls() || closest_.distance <= 0.0) return Start::kAnswered;
  }
  begin_search();
  return Start::kSearches;
}

bool SurfacePairSearch::run(const Goal& goal, int* steps) {
  goal_ = goal;
  update_prune_bound();
  if (!is_searching_) {
    const Start started = start(steps);
    if (started != Start::kSearches) return started == Start::kAnswered;
  }
  while (!queue_.empty() && closest_.distance > 0.0) {
    const Entry entry = queue_.front();
    if (wants_slack_ && looked_at_ >= kSlackPairs) {
      wants_slack_ = false;
      update_prune_bound();
    }
    if (!is_wanted(bound_at(entry.key))) return true;
    if (*steps <= 0) return false;
    if (looked_at_ >= next_plane_) prove_by_plane();
    if (!is_wanted(plane_bound())) return true;
    std::pop_heap(queue_.begin(), queue_.end());
    queue_.pop_back();
    if (queue_.size() + kept_.size() + SurfaceBvh::kWidth + 1 > capacity_) {
      visit_depth_first(entry, steps);
    } else {
      visit(entry, steps);
    }
  }
  return true;
}

// [m] A lower bound of a pair by the hulls of what is below it; 0: there are none, or they are no
// farther apart than what is asked for.
double SurfacePairSearch::bound_by_hulls(const Pair& pair) {
  const HullCoreset *hull_a = a_.hull_of(pair.a), *hull_b = b_.hull_of(pair.b);
  if (hull_a == nullptr || hull_b == nullptr) return 0.0;
  // Hulls of a size that does not answer are asked no longer.
  const double share = (a_.radius(pair.a) + b_.radius(pair.b)) / (a_.extent() + b_.extent());
  HullAnswers& answers =
      hull_answers_[static_cast<std::size_t>(std::clamp(-std::ilogb(share), 0, kHullSizes - 1))];
  if (answers.asked >= kHullsAsked && kHullsPerAnswer * answers.answered < answers.asked)
    return 0.0;
  ++answers.asked;
  HullSupport support;
  support.size = 1;
  support.a[0] = hull_a->farthest(-n_A_.cast<double>());
  support.b[0] = hull_b->farthest(n_B_.cast<double>());
  const double errors = hull_a->error() + hull_b->error() + 2.0 * exact_rounding_;
  const HullDistance hulls =
      hull_distance(*hull_a, *hull_b, X_BA_, 0.0, &support, prune_bound_ + errors);
  const double bound = std::max(hulls.lower_bound - exact_rounding_, 0.0);
  answers.answered += is_wanted(bound) ? 0 : 1;
  return bound;
}

void SurfacePairSearch::visit(const Entry& entry, int* steps) {
  --*steps;
  ++looked_at_;
  const double known = bound_at(entry.key);
  Pair pair{known > 0.0 ? known : -1e30, entry.a, entry.b};
  if (is_leaf(pair)) {
    const double bound = measure(pair);
    keep({bound > 0.0 ? bound + path() : kUnproven, pair.a, pair.b, 0});
    return;
  }
  pair.bound = std::max(pair.bound, bound_by_hulls(pair));
  if (!is_wanted(pair.bound)) {
    keep({pair.bound + path(), pair.a, pair.b, entry.children});
    return;
  }
  const Expansion children = expand(pair, entry.children, prune_bound_);
  if (children.unwanted != 0) {
    keep({children.least_unwanted + path(), pair.a, pair.b, children.unwanted});
  }
  for (int k = 0; k < children.count; ++k) {
    const Pair& child = children.wanted[k];
    queue_.push_back({child.bound > 0.0 ? child.bound + path() : child.bound, child.a, child.b, 0});
    std::push_heap(queue_.begin(), queue_.end());
  }
}

bool SurfacePairSearch::visit_near(double margin, Visitor* visitor, int* steps) {
  prepare_boxes();
  TraversalStack<Pair, kStackCapacity> stack;
  if (!a_.empty() && !b_.empty()) stack.push({-1e30, SurfaceBvh::kRoot, SurfaceBvh::kRoot});
  while (!stack.empty()) {
    const Pair pair = stack.pop();
    if (--*steps < 0) return false;
    if (!is_leaf(pair)) {
      const Expansion children = expand(pair, 0, std::nextafter(margin, kInf));
      for (int k = 0; k < children.count; ++k) stack.push(children.wanted[k]);
      continue;
    }
    const ConvexPart part_a = posed(part_of(a_, pair.a), X_BA_);
    const ConvexPart& part_b = part_of(b_, pair.b);
    const ConvexDistance found = convex_distance(part_a, part_b);
    if (found.lower_bound > margin + exact_rounding_) continue;
    if (!visitor->visit(part_a, part_b)) return false;
  }
  return true;
}

// The pair comes back with the least bound that pruned what is below it.
void SurfacePairSearch::visit_depth_first(const Entry& entry, int* steps) {
  TraversalStack<Pair, kStackCapacity> stack;
  const double known = bound_at(entry.key);
  stack.push({known > 0.0 ? known : -1e30, entry.a, entry.b});
  double least = kInf;
  std::uint8_t mask = entry.children;  // of the first pair
  while (!stack.empty()) {
    const Pair pair = stack.pop();
    if (!is_wanted(pair.bound)) {
      least = std::min(least, pair.bound);
      continue;
    }
    if (closest_.distance <= 0.0 || *steps <= 0) {  // what is known holds
      queue_.push_back(entry);
      std::push_heap(queue_.begin(), queue_.end());
      return;
    }
    --*steps;
    ++looked_at_;
    if (is_leaf(pair)) {
      least = std::min(least, measure(pair));
      continue;
    }
    const Expansion children = expand(pair, mask, prune_bound_);
    mask = 0;
    least = std::min(least, children.least_unwanted);
    const std::size_t first = stack.size();
    for (int k = 0; k < children.count; ++k) {
      stack.push_least_on_top<&Pair::bound>(first, children.wanted[k]);
    }
  }
  // It was searched at this pose, and is not wanted again before the next one.
  keep({least > 0.0 ? least + path() : kUnproven, entry.a, entry.b, entry.children});
}

}  // namespace ist
