// The search of a pose: what the front, the hulls and the closest parts answer, and what is left.

#include "proximity/surface_pair_search.h"

#include <cassert>
#include <cmath>
#include <utility>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// Float's error in the bounds of boxes, as a share of all coordinates and sizes involved.
constexpr double kPairRounding = 2e-6;
// [m] The front is dropped after a longer jump, where it fits no more, and after a longer path, so
// that keys keep their digits.
constexpr double kJump = 0.02, kLongestPairPath = 10.0;
// A search of so many pairs meets ties, such as parallel faces.
constexpr int kManyPairs = 4096;
// Hulls are asked for their distance to this part of the tolerance.
constexpr double kHullShare = 0.25;
// Pairs that may be set aside.
constexpr std::size_t kMostAside = 64;

constexpr std::size_t kStackCapacity =
    stack_capacity(2 * SurfaceBvh::kMaxLevels, SurfaceBvh::kWidth);

}  // namespace

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                                     SurfacePairSearch* memory)
    : a_(a), b_(b), capacity_(capacity) {
  if (memory != nullptr) {
    front_ = std::move(memory->front_);
    aside_ = std::move(memory->aside_);
  }
  assert(capacity >= 2 * SurfaceBvh::kWidth);
  front_.reserve(capacity + 1);  // a pair that was taken always finds a place again
  aside_.reserve(kMostAside);
  start_anew();
  if (is_empty()) return;
  constexpr double kAnywhere = 1e300;  // [m]
  witness_a_ = a_.nearest_part(b_.bounds().center(), kAnywhere);
  witness_b_ = b_.nearest_part(a_.bounds().center(), kAnywhere);
}

void SurfacePairSearch::start_anew() {
  front_.clear();
  aside_.clear();
  least_aside_ = kInfinity;
  is_complete_ = true;
  path_ = moved_ = plane_key_ = 0.0;
  if (!is_empty()) push({kUnproven, SurfaceBvh::kRoot, SurfaceBvh::kRoot, 0});
}

void SurfacePairSearch::move_to(const Eigen::Isometry3d& X_BA, double displacement) {
  X_BA_ = X_BA;
  X_AB_ = X_BA.inverse();
  R_BA_ = X_BA_.linear().cast<float>();
  p_BA_ = X_BA_.translation().cast<float>();
  R_AB_ = X_AB_.linear().cast<float>();
  p_AB_ = X_AB_.translation().cast<float>();
  moved_ = displacement >= 0.0 ? displacement : kInfinity;
  is_at_reference_ = false;
  const double scale = X_BA.translation().norm() + a_.extent() + b_.extent();
  rounding_ = kPairRounding * scale;
  exact_rounding_ = 2.0 * kLostInLength * scale;
  closest_ = {};
  if (!is_empty()) measure(witness_a_, witness_b_);
}

double SurfacePairSearch::lower_bound() const {
  const double key = front_.empty() ? least_aside_ : std::min(least_aside_, front_.front().key);
  return std::max(std::min(std::max(bound_at(key), separation()), closest_.distance), 0.0);
}

double SurfacePairSearch::tolerance_at(double distance) const {
  const double resolved = 1e-12 * distance + 4.0 * exact_rounding_;
  const double tolerance =
      std::max({goal_.tolerance, goal_.relative_tolerance * distance, resolved});
  // After many pairs, bounds that are as near as the rounding of boxes count as equal.
  return looked_at_ > kManyPairs ? std::max(tolerance, 2.0 * rounding_) : tolerance;
}

void SurfacePairSearch::update_prune_bound() {
  const double distance = closest_.distance;
  prune_bound_ =
      distance < goal_.range ? std::max(distance - tolerance_at(distance), 0.0) : goal_.range;
}

// Measures two parts. @returns [m] a lower bound of their distance
double SurfacePairSearch::measure(SurfaceBvh::Slot a, SurfaceBvh::Slot b) {
  const ConvexDistance found = convex_distance(posed(a_.part(a), X_BA_), b_.part(b));
  if (found.distance < closest_.distance) {
    closest_ = found;
    witness_a_ = a;
    witness_b_ = b;
    set_direction();
    update_prune_bound();
  }
  return std::max(0.0, found.lower_bound - exact_rounding_);  // of NaN: the first
}

// The distance of the surfaces along the line through the closest points.
void SurfacePairSearch::prove_by_plane() {
  if (!(closest_.distance > 1e-9 && closest_.distance < goal_.range)) return;
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
    if (is_wanted(gap + exact_rounding_) || !is_wanted(separation())) return;
  }
  keep_plane(middle - a_.support(-n_A) - b_.support(n_B) - exact_rounding_);
}

// Tries the plane between the closest parts found last, then that between the hulls, then that
// between the parts nearest to the hulls' closest points.
void SurfacePairSearch::prove_by_hulls() {
  prove_by_plane();
  if (!is_wanted(separation()) || a_.hull().empty() || b_.hull().empty()) return;
  const double precision = kHullShare * tolerance_at(std::min(closest_.distance, goal_.range));
  const HullDistance hulls = hull_distance(a_.hull(), b_.hull(), X_BA_, precision, &hull_support_);
  keep_plane(hulls.lower_bound - exact_rounding_);
  if (!is_wanted(separation()) || !(hulls.lower_bound > 0.0)) return;
  measure(a_.nearest_part(X_AB_ * hulls.on_a, precision), b_.nearest_part(hulls.on_b, precision));
  if (is_wanted(separation())) prove_by_plane();
}

// [m] A lower bound of a pair by the hulls of what is below it; 0: there are none, or they are no
// farther apart than what is asked for.
double SurfacePairSearch::bound_by_hulls(const Pair& pair) {
  const HullCoreset *hull_a = a_.hull_of(pair.a), *hull_b = b_.hull_of(pair.b);
  if (hull_a == nullptr || hull_b == nullptr) return 0.0;
  HullSupport support;
  support.size = 1;
  support.a[0] = hull_a->farthest(-n_A_.cast<double>());
  support.b[0] = hull_b->farthest(n_B_.cast<double>());
  const double errors = hull_a->error() + hull_b->error() + 2.0 * exact_rounding_;
  const HullDistance hulls =
      hull_distance(*hull_a, *hull_b, X_BA_, 0.0, &support, prune_bound_ + errors);
  return std::max(hulls.lower_bound - exact_rounding_, 0.0);
}

// Begins a search, whose bounds are proven at this pose.
void SurfacePairSearch::begin_search() {
  // A front that costs more than to start anew has become too fine for what is near now.
  if (is_new_) cost_of_new_ = looked_at_;
  const bool is_worn = !is_new_ && looked_at_ > cost_of_new_;
  const bool fits = moved_ <= kJump && path() <= kLongestPairPath && is_complete_ &&
                    front_.size() + aside_.size() <= capacity_;
  is_new_ = is_worn || !fits;
  path_ += moved_;
  moved_ = 0.0;
  if (is_new_) start_anew();
  for (const Entry& entry : aside_) push(entry);
  aside_.clear();
  least_aside_ = kInfinity;
  reference_X_BA_ = X_BA_;
  is_at_reference_ = true;
  looked_at_ = 0;
  prove_by_hulls();
}

bool SurfacePairSearch::run(const Goal& goal, int* steps) {
  goal_ = goal;
  update_prune_bound();
  if (!is_at_reference_) {
    if (closest_.distance <= 0.0 || !is_wanted(lower_bound())) return true;
    if (*steps <= 0) return false;
    --*steps;
    begin_search();
  }
  while (closest_.distance > 0.0 && is_wanted(separation()) && !front_.empty() &&
         is_wanted(bound_at(front_.front().key))) {
    std::pop_heap(front_.begin(), front_.end());
    const Entry entry = front_.back();
    front_.pop_back();
    if (!visit(entry, steps)) {
      front_.push_back(entry);
      std::push_heap(front_.begin(), front_.end());
      return closest_.distance <= 0.0;
    }
  }
  return true;
}

void SurfacePairSearch::push(const Entry& entry) {
  if (front_.size() < capacity_) {
    front_.push_back(entry);
    std::push_heap(front_.begin(), front_.end());
  } else {
    set_aside(entry);
  }
}

void SurfacePairSearch::set_aside(const Entry& entry) {
  least_aside_ = std::min(least_aside_, entry.key);
  is_complete_ = is_complete_ && aside_.size() < kMostAside;
  if (is_complete_) aside_.push_back(entry);
}

// Measures, bounds or divides a pair. Children that a full front has no place for are visited at
// once. @returns false when they are not, since the steps are used up or surfaces intersect
bool SurfacePairSearch::visit(const Entry& entry, int* steps) {
  if (*steps <= 0 || closest_.distance <= 0.0) return false;
  --*steps;
  ++looked_at_;
  const double known = bound_at(entry.key);
  Pair pair{known > 0.0 ? known : -1e30, entry.a, entry.b};
  if (is_leaf(pair)) {
    const double bound = std::max(measure(pair.a, pair.b), known);
    const Entry measured{key_of(bound), pair.a, pair.b, 0};
    // In the front it would be measured again and again.
    is_wanted(bound) ? set_aside(measured) : push(measured);
    return true;
  }
  pair.bound = std::max(pair.bound, bound_by_hulls(pair));
  if (!is_wanted(pair.bound)) {
    push({key_of(pair.bound), pair.a, pair.b, entry.children});
    return true;
  }
  Expansion children = expand(pair, entry.children, prune_bound_);
  if (children.unwanted != 0) {
    push({key_of(children.least_unwanted), pair.a, pair.b, children.unwanted});
  }
  if (front_.size() + SurfaceBvh::kWidth > capacity_) {
    std::sort(children.wanted, children.wanted + children.count,
              [](const Pair& p, const Pair& q) { return p.bound < q.bound; });
  }
  for (int k = 0; k < children.count; ++k) {
    const Pair& child = children.wanted[k];
    const Entry next{child.bound > 0.0 ? child.bound + path() : child.bound, child.a, child.b, 0};
    if (front_.size() < capacity_ || !is_wanted(std::max(child.bound, 0.0))) {
      push(next);
    } else if (!visit(next, steps)) {
      return false;
    }
  }
  return true;
}

bool SurfacePairSearch::visit_near(double margin, Visitor* visitor, int* steps) {
  TraversalStack<Pair, kStackCapacity> stack;
  if (!is_empty()) stack.push({-1e30, SurfaceBvh::kRoot, SurfaceBvh::kRoot});
  while (!stack.empty()) {
    const Pair pair = stack.pop();
    if (--*steps < 0) return false;
    if (!is_leaf(pair)) {
      const Expansion children = expand(pair, 0, std::nextafter(margin, kInfinity));
      for (int k = 0; k < children.count; ++k) stack.push(children.wanted[k]);
      continue;
    }
    const ConvexPart part_a = posed(a_.part(pair.a), X_BA_);
    const ConvexPart& part_b = b_.part(pair.b);
    const ConvexDistance found = convex_distance(part_a, part_b);
    if (found.lower_bound > margin + exact_rounding_) continue;
    if (!visitor->visit(part_a, part_b)) return false;
  }
  return true;
}

}  // namespace ist
