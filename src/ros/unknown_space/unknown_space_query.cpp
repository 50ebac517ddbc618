#include "ros/unknown_space/unknown_space_query.h"

#include <algorithm>
#include <utility>

#include "ros/output/message_conversion.h"

namespace ist {
namespace {

// Unknown space is known to a voxel, so that closer bounds would say no more.
constexpr double kTolerance = 0.01;         // [m]
constexpr double kRelativeTolerance = 0.1;  // of the distance
// Unknown space needs coarse bounds only, and gets this share of a cycle's deadline.
constexpr double kUnknownShare = 0.2;

QueryConfig coarse(QueryConfig config) {
  config.deadline *= kUnknownShare;
  config.tolerance = std::max(config.tolerance, kTolerance);
  config.relative_tolerance = std::max(config.relative_tolerance, kRelativeTolerance);
  return config;
}

}  // namespace

UnknownSpaceQuery::UnknownSpaceQuery(std::shared_ptr<const RobotModel> model,
                                     std::shared_ptr<UnknownSpaceWatch> watch, bool is_only_reader,
                                     bool is_obstacle)
    : model_(std::move(model)),
      watch_(std::move(watch)),
      is_only_reader_(is_only_reader),
      is_obstacle_(is_obstacle),
      query_(model_, {}),
      answers_(model_->links.size()),
      surroundings_(model_->links.size()) {}

void UnknownSpaceQuery::set_model(std::shared_ptr<const RobotModel> model) {
  model_ = std::move(model);
  query_.set_model(model_);
}

std::string UnknownSpaceQuery::run(const StampedLinkPoses& poses, const std::vector<bool>& known,
                                   const std::string& fixed_frame, const LiveConfig& config) {
  const std::vector<Eigen::Isometry3d>& X_FL = poses.X_FL;
  if (!is_only_reader_) held_ = watch_->share();
  const UnknownSnapshot* unknown = is_only_reader_ ? watch_->newest() : held_.get();
  std::string problem;
  if (unknown != nullptr) problem = why_unusable(*unknown, *model_, fixed_frame, poses.stamp);
  if (unknown == nullptr || !problem.empty()) {
    know_nothing();
    return problem;
  }
  placed_.boxes = unknown->boxes;
  placed_.stamp = unknown->stamp;
  placed_.region = {unknown->center_F, unknown->radius};
  query_.set_config(coarse(config.query));
  query_.run(X_FL, known, {&placed_}, &results_);
  for (std::size_t i = 0; i < answers_.size(); ++i) {
    answers_[i].lower_bound = std::max(results_[i].lower_bound, deepest(i));  // -inf: out of time
    answers_[i].direction = -results_[i].direction;  // NaN where nothing is near
    answers_[i].p_FCl = results_[i].p_FCl;
    answers_[i].p_FCo = results_[i].p_FCo;
  }
  const double influence_distance = config.repulsion.influence_distance;
  if (influence_distance != surroundings_distance_) {
    surroundings_.assign(surroundings_.size(), std::nullopt);
    surroundings_distance_ = influence_distance;
  }
  const std::size_t last = next_;
  for (std::size_t i = 1; i <= answers_.size(); ++i) {
    const std::size_t link = (last + i) % answers_.size();
    if (!known[link]) continue;
    next_ = link;
    look_about(link, X_FL[link], poses.stamp.toSec(), influence_distance, *unknown);
    if (is_only_reader_) break;  // another configuration has nothing in common with the last one
  }
  return "";
}

void UnknownSpaceQuery::fill(std::size_t link, double moved,
                             ist_proximity::LinkProximity* message) const {
  const UnknownSpaceAnswer& answer = answers_[link];
  assign_unknown_space(answer.seen, answer.lower_bound - moved, answer.direction, is_obstacle_,
                       message);
}

void UnknownSpaceQuery::draw(std::size_t link, std::size_t place, MarkerScene* scene) const {
  const UnknownSpaceAnswer& answer = answers_[link];
  if (answer.p_FCl.allFinite()) scene->unseen.push_back({place, answer.p_FCl, answer.p_FCo});
}

/// Says that each link may be as deep inside unknown space as it is thick.
void UnknownSpaceQuery::know_nothing() {
  for (std::size_t i = 0; i < answers_.size(); ++i) {
    answers_[i] = UnknownSpaceAnswer();
    answers_[i].lower_bound = deepest(i);
  }
}

/// [m] A lower bound of any signed distance: nothing is deeper inside anything than a link is
/// thick.
double UnknownSpaceQuery::deepest(std::size_t link) const {
  return -2.0 * model_->links[link].tree.radius();
}

/// Finds the seen share of one link, which is what takes longest: the node's cycle does it by
/// turns.
void UnknownSpaceQuery::look_about(std::size_t link, const Eigen::Isometry3d& X_FL, double now,
                                   double influence_distance, const UnknownSnapshot& unknown) {
  std::optional<Surroundings>& surroundings = surroundings_[link];
  if (!surroundings) {
    surroundings.emplace(model_->links[link], watch_->skin(),
                         std::max(influence_distance, 2.0 * watch_->skin()));
  }
  answers_[link].seen = surroundings->look(unknown.seen, X_FL, now);
}

}  // namespace ist
