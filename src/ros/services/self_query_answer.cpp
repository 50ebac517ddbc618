#include "ros/services/self_query_answer.h"

#include <algorithm>

#include "internal/geometry/numbers.h"
#include "ros/output/message_conversion.h"
#include "ros/services/pair_choice.h"

namespace ist {

void SelfQueryAnswer::set_model(const std::shared_ptr<const ModelState>& model) {
  if (model == model_) return;
  const bool is_refined = query_ && model_ && is_refinement(*model_, *model);
  std::vector<LinkPair> watched;
  if (is_refined) watched = query_->pairs();
  query_.reset();
  impacts_.reset();
  model_ = model;
  forward_ = std::make_unique<ForwardKinematics>(*model_->robot, model_->kinematics);
  if (is_refined) query_ = std::make_unique<SelfQuery>(model_->robot, watched, config_.query);
}

void SelfQueryAnswer::choose(const std::vector<bool>& chosen) {
  if (!query_) {
    query_ =
        std::make_unique<SelfQuery>(model_->robot, choose_pairs(model_).watched(), config_.query);
  }
  // A link that is not monitored cannot be asked for: its pairs are among all.
  const bool all = std::find(chosen.begin(), chosen.end(), false) == chosen.end();
  std::vector<bool> is_chosen(model_->robot->links.size(), all);
  for (std::size_t i = 0; i < chosen.size(); ++i) is_chosen[model_->monitored[i]] = chosen[i];
  pairs_.clear();
  for (std::size_t i = 0; i < query_->pairs().size(); ++i) {
    const LinkPair& pair = query_->pairs()[i];
    if (is_chosen[pair.first] || is_chosen[pair.second]) pairs_.push_back(i);
  }
}

void SelfQueryAnswer::add(const StatedPoseSource& poses, const QueryConfig& query,
                          std::vector<ist_proximity::LinkPairProximity>* answers) {
  query_->set_config(query);
  const LinkPoses& links = forward_->run(poses.joints(), poses.X_FR());
  std::vector<bool> known(links.known.size(), false);
  for (const std::size_t i : pairs_) {  // no more pairs are measured than needed
    const LinkPair& pair = query_->pairs()[i];
    for (const std::size_t link : {pair.first, pair.second}) {
      known[link] = links.known[link] && poses.is_root_known();
    }
  }
  query_->run(links.X_FL, known, &results_);
  for (const std::size_t i : pairs_) {
    answers->push_back(pair_message(*model_->robot, query_->pairs()[i], results_[i]));
  }
}

void SelfQueryAnswer::begin_motion() {
  if (!impacts_) {
    impacts_ = std::make_unique<TimeOfSelfImpact>(model_->robot, model_->kinematics,
                                                  query_->pairs(), config_.query);
  }
  wanted_.assign(query_->pairs().size(), false);
  for (const std::size_t i : pairs_) wanted_[i] = true;
  first_.assign(pairs_.size(), kInfinity);
}

void SelfQueryAnswer::advance(const JointMotion& motion, double start, const JointPoses& still,
                              const QueryConfig& query) {
  impacts_->set_config(query);
  std::vector<ImpactTime> impacts;
  impacts_->run(motion, still, wanted_, &impacts);
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    const std::size_t pair = pairs_[k];
    if (!wanted_[pair] || impacts[pair].time == kInfinity) continue;
    first_[k] = start + impacts[pair].time;  // NaN: not known, and neither is what comes later
    wanted_[pair] = false;
  }
}

}  // namespace ist
