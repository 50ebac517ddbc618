#include "internal/repulsion/coherent_queries.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "internal/proximity/deadline.h"

namespace ist {
namespace {

// The share of a warm-up's time at which distances have to be there.
constexpr double kQueryShare = 0.7;

}  // namespace

CoherentQueries::CoherentQueries(const std::shared_ptr<const RobotModel>& model,
                                 const QueryConfig& config)
    : CoherentQueries(model, config, Repulsion(model)) {}

CoherentQueries::CoherentQueries(std::shared_ptr<const RobotModel> model, const QueryConfig& config,
                                 Repulsion repulsion)
    : model_(std::move(model)),
      query_(model_, config),
      repulsion_(std::move(repulsion)),
      answers_(model_->links.size()) {
  blends_.reserve(model_->links.size());
  for (std::size_t i = 0; i < model_->links.size(); ++i) blends_.emplace_back(i);
}

SnapshotSpan CoherentQueries::clouds_for(std::size_t link, SnapshotSpan clouds) {
  const std::string& name = model_->links[link].name;
  const auto is_for = [&name](const CloudSnapshot* cloud) { return cloud->is_for(name); };
  if (std::all_of(clouds.begin(), clouds.end(), is_for)) return clouds;
  clouds_.clear();
  std::copy_if(clouds.begin(), clouds.end(), std::back_inserter(clouds_), is_for);
  return clouds_;
}

void CoherentQueries::forget_repulsion() {
  for (KeptRepulsion& blend : blends_) blend.forget();
}

void CoherentQueries::warm_up(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                              SnapshotSpan clouds, const QueryConfig& config,
                              const RepulsionConfig& repulsion, double limit) {
  const TimePoint end = end_of(limit, 1.0, std::chrono::steady_clock::now());
  QueryConfig limited = config;
  limited.deadline = kQueryShare * limit;
  query_.set_config(limited);
  query_.run(X_FL, known, clouds, &answers_);
  for (std::size_t i = 0; i < answers_.size(); ++i) {
    if (answers_[i].state != LinkState::kUnknown) {
      repel(i, X_FL[i], clouds, answers_[i], repulsion, end);
    }
  }
}

void CoherentQueries::set_model(std::shared_ptr<const RobotModel> model,
                                const Repulsion& repulsion) {
  for (std::size_t i = 0; i < blends_.size(); ++i) {
    const std::uint64_t id = model->links[i].packing_id;  // 0: not known
    if (id == 0 || id != model_->links[i].packing_id) blends_[i] = KeptRepulsion(i);
  }
  model_ = std::move(model);
  query_.set_model(model_);
  repulsion_ = repulsion;
}

}  // namespace ist
