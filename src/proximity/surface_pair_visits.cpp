// What becomes of a pair that is looked at: it is measured, bounded, or divided.

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/bvh/traversal_stack.h"
#include "proximity/surface_pair_search.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// After so many questions to hulls of nodes of a size, one of so many has to be answered.
constexpr int kHullsAsked = 8, kHullsPerAnswer = 4;

constexpr std::size_t kStackCapacity =
    stack_capacity(2 * SurfaceBvh::kMaxLevels, SurfaceBvh::kWidth);

}  // namespace

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
    const ConvexPart part_a = posed(a_.part(pair.a), X_BA_);
    const ConvexPart& part_b = b_.part(pair.b);
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
