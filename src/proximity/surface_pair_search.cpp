// The search of a pose: what the front, the hulls and the closest parts answer, and what is left.

#include "proximity/surface_pair_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

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

}  // namespace

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
  const auto rebase = [this](double* key) { *key = *key > path_ ? *key - path_ : kUnproven; };
  for (std::vector<Entry>* entries : {&queue_, &kept_}) {
    for (Entry& entry : *entries) rebase(&entry.key);
  }
  rebase(&least_kept_);
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

// Measures two parts. @returns [m] a lower bound of their distance
double SurfacePairSearch::measure(const Pair& pair) {
  const ConvexDistance found = convex_distance(posed(a_.part(pair.a), X_BA_), b_.part(pair.b));
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

ConvexPart SurfacePairSearch::part_a() const { return posed(a_.part(witness_a_), X_BA_); }

const ConvexPart& SurfacePairSearch::part_b() const { return b_.part(witness_b_); }

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

}  // namespace ist
