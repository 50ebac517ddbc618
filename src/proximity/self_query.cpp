#include "ist_proximity/proximity/self_query.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr int kMaxSteps = 20;  // to and fro between two surfaces

// Two posed links: A, whose points are searched, and B, whose distance they have.
class PairSearch {
 public:
  struct Item {
    double bound;        // [m] no point of A that it covers is nearer to B
    std::int32_t child;  // >= 0: inner node; < 0: leaf ~child
    bool operator<(const Item& other) const { return bound > other.bound; }  // smallest on top
  };

  PairSearch(const LinkModel& a, const LinkModel& b, const Eigen::Isometry3d& X_BA,
             const QueryConfig& config, std::vector<Item>* queue)
      : a_(a),
        b_(b),
        X_BA_(X_BA),
        X_AB_(X_BA.inverse()),
        config_(config),
        has_holes_(!a.solid.is_closed() || !b.solid.is_closed()),
        queue_(*queue) {}

  void run() {
    queue_.clear();
    push(a_.tree.center(), a_.tree.radius(), 0);
    while (!queue_.empty() && queue_.front().bound < enough()) {
      std::pop_heap(queue_.begin(), queue_.end());
      const std::int32_t child = queue_.back().child;
      queue_.pop_back();
      if (child >= 0) {
        const SphereNode& node = a_.tree.nodes()[static_cast<std::size_t>(child)];
        for (int k = 0; k < node.count; ++k) {
          push({node.x[k], node.y[k], node.z[k]}, node.radius[k], node.child[k]);
        }
      } else {
        look_at(a_.tree.leaves()[static_cast<std::size_t>(~child)]);
      }
    }
    if (!queue_.empty()) lower_ = std::min(lower_, queue_.front().bound);
    lower_ = std::min(lower_, best_.distance);
    lower_ -= beyond_spheres();
  }

  double lower() const { return lower_; }
  double distance() const { return best_.distance; }
  const Eigen::Vector3d& p_BA() const { return p_BA_; }          // witness on A, in B
  const Eigen::Vector3d& p_BB() const { return best_.witness; }  // on B
  const Eigen::Vector3d& normal_B() const { return best_.normal; }

 private:
  // Spheres cover a link's surface; its inside may be the interior gap farther from them. What is
  // inside cannot be nearest unless something of B is inside A too, or it shows through a hole.
  double beyond_spheres() const {
    const double gap_a = a_.tree.interior_gap(), gap_b = b_.tree.interior_gap();
    if (has_holes_) return gap_a + gap_b;
    return lower_ <= gap_a ? gap_a : 0.0;
  }

  // What lies at or beyond this changes neither bound nor, by the tolerance, the distance. While
  // the bound alone allows contact, all that may be in contact is looked at.
  double enough() const {
    const double decided = lower_ > 0.0 || best_.distance < 0.0 ? lower_ : 0.0;
    const double beyond = has_holes_ ? beyond_spheres() : 0.0;
    return std::min({decided, best_.distance - config_.tolerance, config_.max_distance + beyond});
  }

  // What B's spheres alone prove of all points within `radius` of p_B: a lower bound of their
  // signed distance; -inf: nothing. Through a hole the signed distance jumps, so there all of them
  // must be outside.
  double far_bound(const Eigen::Vector3d& p_B, double radius) const {
    const double gap = b_.tree.interior_gap();
    const double outer = b_.tree.cover_distance(p_B, gap + (has_holes_ ? radius : 0.0));
    return outer > gap + (has_holes_ ? radius : 0.0) ? outer - radius : -kInf;
  }

  void push(const Eigen::Vector3d& p_A, double radius, std::int32_t child) {
    const Eigen::Vector3d p_B = X_BA_ * p_A;
    double bound = far_bound(p_B, radius);
    if (bound == -kInf) {
      bound = distance_floor(b_.solid, p_B, b_.solid.signed_distance(p_B)) - radius;
    }
    if (bound >= enough()) return skip(bound);
    queue_.push_back({bound, child});
    std::push_heap(queue_.begin(), queue_.end());
  }

  // Not looked at, and so a bound of its own where best and lower move on.
  void skip(double bound) { lower_ = std::min(lower_, bound); }

  void look_at(const SphereLeaf& leaf) {
    for (int k = 0; k < leaf.count; ++k) {
      const Eigen::Vector3d p_A(leaf.x[k], leaf.y[k], leaf.z[k]), p_B = X_BA_ * p_A;
      const double far = far_bound(p_B, leaf.cover_radius[k]);
      if (far >= enough()) {
        skip(far);
        continue;
      }
      const SignedDistance measured = b_.solid.signed_distance(p_B);
      const double near = distance_floor(b_.solid, p_B, measured) - leaf.cover_radius[k];
      lower_ = std::min(lower_, std::max(near, far));
      if (measured.distance < std::max(leaf.inner_radius[k], 0.0F)) {
        go_deeper(p_A, measured, leaf.inner_radius[k]);
      }
      go_to_and_fro(measured.witness);
    }
  }

  // A sphere of A that reaches into B: its centre, and points of it that are deeper, it may be.
  void go_deeper(const Eigen::Vector3d& p_A, const SignedDistance& measured, double inner) {
    const Eigen::Vector3d p_B = X_BA_ * p_A;
    if (measured.distance < best_.distance && a_.solid.is_inside(p_A)) take(p_B, measured);
    const double most = 0.999 * std::max(inner, 0.0), least = std::max(measured.distance, 0.0);
    for (const double step : {most, 0.5 * (least + most)}) {
      const Eigen::Vector3d deeper_B = p_B - step * measured.normal;
      const SignedDistance deeper = b_.solid.signed_distance(deeper_B);
      if (deeper.distance < best_.distance && a_.solid.is_inside(X_AB_ * deeper_B)) {
        take(deeper_B, deeper);
      }
    }
  }

  // From a point of B to A's nearest, from there to B's nearest, and so on.
  void go_to_and_fro(Eigen::Vector3d q_B) {
    for (int step = 0; step < kMaxSteps; ++step) {
      const Eigen::Vector3d q_A = X_AB_ * q_B;
      const SignedDistance on_a = a_.solid.signed_distance(q_A);
      const Eigen::Vector3d p_B = X_BA_ * on_a.witness;
      const SignedDistance measured = b_.solid.signed_distance(p_B);
      const double gain = best_.distance - measured.distance;
      if (!(gain > 0.0)) return;
      take(p_B, measured);
      if (gain < 0.01 * config_.tolerance) return;
      q_B = measured.witness;
    }
  }

  void take(const Eigen::Vector3d& p_B, const SignedDistance& measured) {
    p_BA_ = p_B;
    best_ = measured;
  }

  const LinkModel &a_, &b_;
  const Eigen::Isometry3d X_BA_, X_AB_;
  const QueryConfig& config_;
  const bool has_holes_;
  std::vector<Item>& queue_;
  double lower_ = kInf;
  SignedDistance best_;  // of p_BA_
  Eigen::Vector3d p_BA_ = Eigen::Vector3d::Zero();
};

}  // namespace

void PairProximity::reset() {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  state = LinkState::kUnknown;
  distance = kNaN;
  lower_bound = -kInf;
  p_FCa = p_FCb = direction = Eigen::Vector3d::Constant(kNaN);
}

struct SelfQuery::Impl {
  void run(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL, PairProximity* result);

  std::shared_ptr<const RobotModel> model;
  std::vector<LinkPair> pairs;
  QueryConfig config;
  std::vector<PairSearch::Item> queue;
};

SelfQuery::SelfQuery(std::shared_ptr<const RobotModel> model, std::vector<LinkPair> pairs,
                     const QueryConfig& config)
    : impl_(std::make_unique<Impl>()) {
  impl_->model = std::move(model);
  impl_->pairs = std::move(pairs);
  impl_->config = config;
}
SelfQuery::~SelfQuery() = default;
SelfQuery::SelfQuery(SelfQuery&&) noexcept = default;
SelfQuery& SelfQuery::operator=(SelfQuery&&) noexcept = default;

void SelfQuery::set_config(const QueryConfig& config) { impl_->config = config; }

const std::vector<LinkPair>& SelfQuery::pairs() const { return impl_->pairs; }

void SelfQuery::Impl::run(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL,
                          PairProximity* result) {
  QueryConfig range = config;  // bounds have the margin taken off
  range.max_distance += config.margin;
  const auto search = [&](std::size_t a, std::size_t b) {
    PairSearch found(model->links[a], model->links[b], X_FL[b].inverse() * X_FL[a], range, &queue);
    found.run();
    return found;
  };
  const auto report = [&](const PairSearch& found, std::size_t b, double sign) {
    if (found.distance() >= result->distance) return;
    result->distance = found.distance();
    result->p_FCa = X_FL[b] * (sign > 0.0 ? found.p_BA() : found.p_BB());
    result->p_FCb = X_FL[b] * (sign > 0.0 ? found.p_BB() : found.p_BA());
    result->direction = sign * (X_FL[b].linear() * found.normal_B());
  };
  // The link that is packed closer gives the tighter bound; apart, one way is as good as the other.
  const auto gap = [&](std::size_t i) { return model->links[i].packing.certificate.max_gap; };
  const bool swapped = gap(pair.second) < gap(pair.first);
  const std::size_t a = swapped ? pair.second : pair.first;
  const std::size_t b = swapped ? pair.first : pair.second;
  const double sign = swapped ? -1.0 : 1.0;
  const PairSearch one_way = search(a, b);
  double lower = one_way.lower();
  result->distance = kInf;
  if (lower >= range.max_distance) {
    result->state = LinkState::kClear;
    result->lower_bound = config.max_distance;
    return;
  }
  report(one_way, b, sign);
  if (lower <= 0.0) {
    const PairSearch other_way = search(b, a);
    lower = std::min(lower, other_way.lower());
    report(other_way, a, -sign);
  }
  result->state = result->distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  result->lower_bound = lower - config.margin;
}

void SelfQuery::run(const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<bool>& known,
                    std::vector<PairProximity>* results) {
  const auto& links = impl_->model->links;
  assert(X_FL.size() == links.size() && known.size() == links.size());
  results->resize(impl_->pairs.size());
  const auto can_query = [&](std::size_t i) {
    return known[i] && links[i].usable() && !links[i].tree.empty();
  };
  for (std::size_t i = 0; i < impl_->pairs.size(); ++i) {
    const LinkPair& pair = impl_->pairs[i];
    (*results)[i].reset();
    if (can_query(pair.first) && can_query(pair.second)) {
      impl_->run(pair, X_FL, &(*results)[i]);
    }
  }
}

}  // namespace ist
