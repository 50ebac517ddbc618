#include "ros/cycle/cloud_selection.h"

#include <algorithm>
#include <cmath>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

void CloudSelection::update(const ros::Time& now, const CloudSources& sources,
                            const std::shared_ptr<const RobotModel>& model,
                            const ros::Time& poses_stamp, double pose_timeout,
                            StatusInput* status) {
  status->sources.resize(sources.size());
  status->source_statuses.resize(sources.size());
  selected_.clear();
  held_.clear();
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const SourceSnapshot* snapshot =
        sources[i]->parent() != nullptr
            ? memory_of(sources, i)
            : newest(sources[i].get(), model, poses_stamp, pose_timeout);
    SourceReport& report = status->sources[i];
    sources[i]->report(&report);
    if (snapshot) {
      report.has_snapshot = true;
      report.stamp = snapshot->stamp;
      report.counts_from = snapshot->counts_from;
      report.counts = snapshot->cloud.counts;
      report.snapshot_memory = snapshot->cloud.index.memory();
      report.ingest_time = snapshot->cloud.ingest_time;
    }
    status->source_statuses[i] = source_status(report, now.toSec());
    selected_.push_back(snapshot);
  }

  clouds_.clear();
  cloud_sources_.clear();
  cloud_stands_still_.clear();
  worlds_.clear();
  world_sources_.clear();
  surfaces_.reset();
  oldest_stamp_ = ros::Time();
  const bool usable = clouds_usable(*status);
  for (std::size_t i = 0; i < selected_.size(); ++i) {
    // The rest of an incomplete world counts, where it is not required.
    const bool is_incomplete = !status->sources[i].incomplete.empty();
    if (!usable || !(status->source_statuses[i].ok() || is_incomplete)) selected_[i] = nullptr;
    if (!selected_[i]) continue;
    if (selected_[i]->surfaces) {
      worlds_.push_back(&selected_[i]->world);
      world_sources_.push_back(static_cast<int>(i));
      surfaces_ = selected_[i]->surfaces;
      if (!selected_[i]->cloud.boxes) continue;  // it has no octomap
    }
    clouds_.push_back(&selected_[i]->cloud);
    cloud_sources_.push_back(static_cast<int>(i));
    const SourceReport& report = status->sources[i];
    cloud_stands_still_.push_back(report.is_file || report.is_memory || std::isinf(report.timeout));
    const ros::Time& stamp = selected_[i]->stamp;
    if (report.is_file || report.is_memory || selected_[i]->surfaces) continue;
    if (oldest_stamp_.isZero() || stamp < oldest_stamp_) oldest_stamp_ = stamp;
  }
}

/// What belongs to the snapshot of a source that was taken before: no cloud is ever combined with
/// what is hidden from another one.
const SourceSnapshot* CloudSelection::memory_of(const CloudSources& sources,
                                                std::size_t source) const {
  for (std::size_t i = 0; i < source; ++i) {
    if (sources[i].get() != sources[source]->parent()) continue;
    return selected_[i] != nullptr ? selected_[i]->memory.get() : nullptr;
  }
  return nullptr;
}

const SourceSnapshot* CloudSelection::newest(ObstacleSource* source,
                                             const std::shared_ptr<const RobotModel>& model,
                                             const ros::Time& poses_stamp, double pose_timeout) {
  if (reader_ == Reader::kOnly) return source->newest(model, poses_stamp, pose_timeout);
  held_.push_back(source->share(model, poses_stamp, pose_timeout));
  return held_.back().get();
}

ClosingSpeed::Nearest CloudSelection::nearest(const LinkProximity& answer) const {
  const auto cloud = static_cast<std::size_t>(answer.source);
  if (answer.source < 0 || cloud >= clouds_.size()) return {};
  return {cloud_sources_[cloud], obstacles_key({clouds_[cloud]}), clouds_[cloud]->stamp,
          cloud_stands_still_[cloud]};
}

int CloudSelection::source_of(const LinkProximity& answer) const {
  const auto cloud = static_cast<std::size_t>(answer.source);
  return answer.source < 0 || cloud >= clouds_.size() ? -1 : cloud_sources_[cloud];
}

void CloudSelection::exclude_unfiltered(std::vector<bool>* links) const {
  for (const SourceSnapshot* snapshot : selected_) {
    if (!snapshot || snapshot->filtered.empty()) continue;
    for (std::size_t i = 0; i < links->size(); ++i) {
      (*links)[i] = (*links)[i] && snapshot->filtered[i];
    }
  }
}

}  // namespace ist
