#include "proximity/surface_pair_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
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

}  // namespace

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity)
    : a_(a), b_(b), capacity_(capacity) {
  assert(capacity >= 2 * SurfaceBvh::kWidth);
  front_.reserve(capacity);
  measured_.reserve(capacity);
  start_anew();
}

SurfacePairSearch::SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                                     SurfacePairSearch&& memory)
    : a_(a),
      b_(b),
      capacity_(capacity),
      front_(std::move(memory.front_)),
      measured_(std::move(memory.measured_)) {
  assert(capacity >= 2 * SurfaceBvh::kWidth);
  front_.reserve(capacity);
  measured_.reserve(capacity);
  start_anew();
}

void SurfacePairSearch::start_anew() {
  front_.clear();
  measured_.clear();
  path_ = plane_path_ = plane_bound_ = 0.0;
  if (!a_.empty() && !b_.empty()) {
    front_.push_back({kUnproven, SurfaceBvh::kRoot, SurfaceBvh::kRoot});
  }
}

void SurfacePairSearch::move_to(const Eigen::Isometry3d& X_BA, double displacement) {
  X_BA_ = X_BA;
  const Eigen::Isometry3d X_AB = X_BA.inverse();
  R_BA_ = X_BA.linear().cast<float>();
  p_BA_ = X_BA.translation().cast<float>();
  R_AB_ = X_AB.linear().cast<float>();
  p_AB_ = X_AB.translation().cast<float>();
  const double scale = X_BA.translation().norm() + a_.extent() + b_.extent();
  rounding_ = kBoxRounding * scale;
  exact_rounding_ = 2.0 * kLostInLength * scale;
  // A front that costs more than to start anew has become too fine for what is near now.
  if (is_new_) cost_of_new_ = looked_at_;
  const bool is_worn = !is_new_ && looked_at_ > cost_of_new_;
  const bool is_crowded = 4 * (front_.size() + measured_.size()) > 3 * capacity_;
  is_new_ = !(displacement <= kJump) || is_worn || is_crowded;
  looked_at_ = next_plane_ = 0;
  plane_tried_ = 0.0;
  if (is_new_) {
    start_anew();
  } else {
    keep_measured();
    path_ += displacement;
    if (path_ > kLongestPath) rebase_path();
  }
  closest_ = {};
  if (has_witness_) {
    measure({0.0, witness_a_, witness_b_});
  } else {
    set_direction();
  }
  if (!(displacement <= kJump) && !front_.empty()) descend();
}

void SurfacePairSearch::keep_measured() {
  for (const Entry& entry : measured_) {
    front_.push_back(entry);
    std::push_heap(front_.begin(), front_.end());
  }
  measured_.clear();
}

void SurfacePairSearch::rebase_path() {
  // A key that was below the path by now proves nothing.
  for (Entry& entry : front_) entry.key = entry.key > path_ ? entry.key - path_ : kUnproven;
  std::make_heap(front_.begin(), front_.end());
  plane_bound_ -= path_ - plane_path_;
  path_ = plane_path_ = 0.0;
}

double SurfacePairSearch::bound_of(const Entry& entry) const {
  return entry.key < 0.0 ? 0.0 : std::max(entry.key - path_ * (1.0 + 1e-14), 0.0);
}

double SurfacePairSearch::lower_bound() const {
  double bound = closest_.distance;
  if (!front_.empty()) bound = std::min(bound, bound_of(front_.front()));
  for (const Entry& entry : measured_) bound = std::min(bound, bound_of(entry));
  const double by_plane = plane_bound_ - (path_ - plane_path_) * (1.0 + 1e-14);
  return std::max({bound, std::min(by_plane, closest_.distance), 0.0});
}

double SurfacePairSearch::tolerance_at(double distance) const {
  const double resolved = 1e-12 * distance + 4.0 * exact_rounding_;
  const double tolerance =
      std::max({goal_.tolerance, goal_.relative_tolerance * distance, resolved});
  return looked_at_ > kManyPairs ? std::max(tolerance, 2.0 * rounding_) : tolerance;
}

void SurfacePairSearch::update_prune_bound() {
  const double distance = closest_.distance;
  prune_bound_ =
      distance < goal_.range ? std::max(distance - tolerance_at(distance), 0.0) : goal_.range;
}

bool SurfacePairSearch::is_wanted(double bound) const {
  return bound < prune_bound_ || bound <= 0.0;
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

bool SurfacePairSearch::is_leaf(const Pair& pair) const {
  return a_.child(pair.a) < 0 && b_.child(pair.b) < 0;
}

// A bound of boxes, or for boxes that overlap a number below 0 that orders small ones first: they
// lead to an intersection soonest.
double SurfacePairSearch::bound(double measured, const Pair& pair) const {
  const double bound = measured - rounding_;
  if (bound > 0.0) return bound;
  return -1.0 / (a_.radius(pair.a) + b_.radius(pair.b) + 1e-30);
}

// The children of the larger box beside the smaller one.
int SurfacePairSearch::expand(const Pair& pair, Pair children[SurfaceBvh::kWidth]) {
  const std::int32_t child_a = a_.child(pair.a), child_b = b_.child(pair.b);
  const bool of_a = child_b < 0 || (child_a >= 0 && a_.radius(pair.a) >= b_.radius(pair.b));
  alignas(32) float bounds[SurfaceBvh::kWidth];
  const SurfaceBvh::Node& node = of_a ? a_.node(child_a) : b_.node(child_b);
  if (of_a) {
    oriented_box_bounds(node, posed_box(b_, pair.b, R_AB_, p_AB_, n_A_), bounds);
  } else {
    oriented_box_bounds(node, posed_box(a_, pair.a, R_BA_, p_BA_, -n_B_), bounds);
  }
  const auto first = static_cast<SurfaceBvh::Slot>((of_a ? child_a : child_b) * SurfaceBvh::kWidth);
  for (int k = 0; k < node.count; ++k) {
    Pair& child = children[k];
    child = pair;
    (of_a ? child.a : child.b) = first + static_cast<SurfaceBvh::Slot>(k);
    child.bound = std::max(bound(bounds[k], child), pair.bound);
  }
  return node.count;
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
    set_direction();
    update_prune_bound();
  }
  return std::max(found.lower_bound - exact_rounding_, 0.0);
}

ConvexPart SurfacePairSearch::part_a() const { return posed(part_of(a_, witness_a_), X_BA_); }

const ConvexPart& SurfacePairSearch::part_b() const { return part_of(b_, witness_b_); }

// Finds an upper bound: from the roots on, always the child with the least bound.
void SurfacePairSearch::descend() {
  Pair pair{-1.0, SurfaceBvh::kRoot, SurfaceBvh::kRoot};
  while (!is_leaf(pair)) {
    Pair children[SurfaceBvh::kWidth];
    const int count = expand(pair, children);
    pair = *std::min_element(children, children + count,
                             [](const Pair& p, const Pair& q) { return p.bound < q.bound; });
    pair.bound = -1e30;
  }
  measure(pair);
}

void SurfacePairSearch::push(const Entry& entry) {
  front_.push_back(entry);
  std::push_heap(front_.begin(), front_.end());
}

// The distance of the surfaces along the line through the closest points, if these have changed.
void SurfacePairSearch::prove_by_plane() {
  next_plane_ = 2 * looked_at_ + kFirstPlane;
  if (!(closest_.distance > 1e-9 && closest_.distance < goal_.range)) return;
  if (plane_tried_ == closest_.distance) return;
  plane_tried_ = closest_.distance;
  const Eigen::Vector3d n_B = (closest_.on_p - closest_.on_q) / closest_.distance;
  const Eigen::Vector3d n_A = X_BA_.linear().transpose() * n_B;
  const double below = b_.support(n_B);
  const double above = n_B.dot(X_BA_.translation()) - a_.support(-n_A);
  const double bound = above - below - exact_rounding_;
  if (bound < plane_bound_ - (path_ - plane_path_)) return;
  plane_bound_ = bound;
  plane_path_ = path_;
}

bool SurfacePairSearch::run(const Goal& goal, int* steps) {
  goal_ = goal;
  update_prune_bound();
  while (!front_.empty() && closest_.distance > 0.0) {
    const Entry entry = front_.front();
    if (!is_wanted(bound_of(entry))) return true;
    if (*steps <= 0) return false;
    if (looked_at_ >= next_plane_) prove_by_plane();
    if (!is_wanted(plane_bound_ - (path_ - plane_path_) * (1.0 + 1e-14))) return true;
    std::pop_heap(front_.begin(), front_.end());
    front_.pop_back();
    if (front_.size() + measured_.size() + SurfaceBvh::kWidth > capacity_) {
      visit_depth_first(entry, steps);
    } else {
      visit(entry, steps);
    }
  }
  return true;
}

void SurfacePairSearch::visit(const Entry& entry, int* steps) {
  --*steps;
  ++looked_at_;
  const Pair pair{bound_of(entry) > 0.0 ? bound_of(entry) : -1e30, entry.a, entry.b};
  if (is_leaf(pair)) {
    const double bound = measure(pair);
    measured_.push_back({bound > 0.0 ? bound + path_ : kUnproven, pair.a, pair.b});
    return;
  }
  Pair children[SurfaceBvh::kWidth];
  const int count = expand(pair, children);
  for (int k = 0; k < count; ++k) {
    const Pair& child = children[k];
    push({child.bound > 0.0 ? child.bound + path_ : child.bound, child.a, child.b});
  }
}

bool SurfacePairSearch::visit_near(double margin, Visitor* visitor, int* steps) {
  TraversalStack<Pair, kStackCapacity> stack;
  if (!a_.empty() && !b_.empty()) stack.push({-1e30, SurfaceBvh::kRoot, SurfaceBvh::kRoot});
  while (!stack.empty()) {
    const Pair pair = stack.pop();
    if (--*steps < 0) return false;
    if (!is_leaf(pair)) {
      Pair children[SurfaceBvh::kWidth];
      const int count = expand(pair, children);
      for (int k = 0; k < count; ++k) {
        if (children[k].bound <= margin) stack.push(children[k]);
      }
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
  const double known = bound_of(entry);
  stack.push({known > 0.0 ? known : -1e30, entry.a, entry.b});
  double least = kInf;
  while (!stack.empty()) {
    const Pair pair = stack.pop();
    if (!is_wanted(pair.bound)) {
      least = std::min(least, pair.bound);
      continue;
    }
    if (closest_.distance <= 0.0 || *steps <= 0) {  // what is known holds
      push(entry);
      return;
    }
    --*steps;
    ++looked_at_;
    if (is_leaf(pair)) {
      least = std::min(least, measure(pair));
      continue;
    }
    Pair children[SurfaceBvh::kWidth];
    const int count = expand(pair, children);
    const std::size_t first = stack.size();
    for (int k = 0; k < count; ++k) stack.push_least_on_top<&Pair::bound>(first, children[k]);
  }
  // It was searched at this pose, and is not wanted again before the next one.
  measured_.push_back({least > 0.0 ? least + path_ : kUnproven, entry.a, entry.b});
}

}  // namespace ist
