#include "ros/cycle/cloud_selection.h"

#include <ist_proximity/ProximityArray.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {
namespace {

/// Whether what a source has counts as an obstacle: where others vouch for what is free, also what
/// is left of an incomplete source, and what a silent one remembers.
bool is_obstacle(std::size_t source, const StatusInput& status) {
  const SourceReport& report = status.sources[source];
  const bool is_incomplete =
      report.status.code == ist_proximity::ProximityArray::NO_CLOUD && !report.incomplete.empty();
  return report.status.ok() || is_incomplete || report.is_memory;
}

}  // namespace

void CloudSelection::update(const ros::Time& now, const CloudSources& sources,
                            const SnapshotRequest& request, StatusInput* status) {
  status->sources.resize(sources.size());
  time_ = request.time.toSec();
  motions_.resize(sources.size());
  selected_.clear();
  held_.clear();
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const SourceSnapshot* snapshot = newest(sources, i, request, *status);
    SourceReport& report = status->sources[i];
    sources[i]->report(&report);
    if (snapshot) {
      report.has_snapshot = true;
      report.stamp = snapshot->stamp;
      report.counts_from = snapshot->counts_from;
      report.counts = snapshot->cloud.counts;
      report.snapshot_memory = snapshot->cloud.index.memory();
      report.ingest_time = snapshot->cloud.ingest_time;
      // An object is missing until a snapshot holds it, whatever the report says by now.
      if (report.incomplete.empty()) report.incomplete = snapshot->incomplete;
      if (!snapshot->has_messages) report.messages = 0;
      if (!snapshot->unplaced.empty() && !report.incomplete.empty()) report.incomplete += "; ";
      report.incomplete += snapshot->unplaced;
    }
    const std::size_t parent = parent_of(sources, i);
    report.status = parent == i ? source_status(report, now.toSec())
                                : memory_status(report, status->sources[parent].status);
    selected_.push_back(snapshot);
  }
  take_obstacles(*status);
}

/// Sorts the snapshots that count into clouds and worlds.
void CloudSelection::take_obstacles(const StatusInput& status) {
  clouds_.clear();
  cloud_sources_.clear();
  cloud_stands_still_.clear();
  worlds_.clear();
  world_sources_.clear();
  surfaces_.reset();
  oldest_stamp_ = ros::Time();
  const bool usable = clouds_usable(status);
  for (std::size_t i = 0; i < selected_.size(); ++i) {
    if (!usable || !is_obstacle(i, status)) selected_[i] = nullptr;
    if (!selected_[i]) continue;
    if (selected_[i]->surfaces) {
      worlds_.push_back(&selected_[i]->world);
      world_sources_.push_back(static_cast<int>(i));
      surfaces_ = selected_[i]->surfaces;
      if (!selected_[i]->cloud.boxes) continue;  // it has no octomap
    }
    add_clouds(*selected_[i], &clouds_);
    const SourceReport& report = status.sources[i];
    cloud_sources_.resize(clouds_.size(), static_cast<int>(i));
    cloud_stands_still_.resize(clouds_.size(), stands_still(i, report));
    const ros::Time& stamp = selected_[i]->stamp;
    if (report.is_file || report.is_memory || selected_[i]->surfaces) continue;
    if (oldest_stamp_.isZero() || stamp < oldest_stamp_) oldest_stamp_ = stamp;
  }
}

/// Whether the obstacles of a source that never goes stale do not move: those of a map's frame that
/// has not for a while, or of a cloud after which none has come for as long.
bool CloudSelection::stands_still(std::size_t source, const SourceReport& report) {
  const CloudSnapshot& cloud = selected_[source]->cloud;
  if (report.is_memory || (report.is_file && !cloud.boxes)) return true;
  Motion& motion = motions_[source];
  const std::uint64_t before = std::exchange(motion.cloud, obstacles_key({&cloud}));
  motion.place.note({&cloud.X_FM, 1}, time_, !cloud.boxes && motion.cloud != before);
  return (report.is_file || std::isinf(report.timeout)) && motion.place.stands_still(time_);
}

/// The newest snapshot of a source. What is hidden from a cloud belongs to its snapshot: no cloud
/// is ever combined with what is hidden from another one. Beside a cloud that is not used, all that
/// its source remembers is an obstacle.
const SourceSnapshot* CloudSelection::newest(const CloudSources& sources, std::size_t source,
                                             const SnapshotRequest& request,
                                             const StatusInput& status) {
  const std::size_t parent = parent_of(sources, source);
  if (parent != source && selected_[parent] != nullptr && is_obstacle(parent, status)) {
    return selected_[parent]->memory.get();
  }
  if (reader_ == Reader::kOnly) return sources[source]->newest(request);
  held_.push_back(sources[source]->share(request));
  return held_.back().get();
}

ClosingSpeed::Nearest CloudSelection::nearest(const LinkProximity& answer, int source) const {
  if (source < 0) return {};
  // The points in zones are of the same measurement.
  const CloudSnapshot& whole = selected_[static_cast<std::size_t>(source)]->cloud;
  const bool stands_still = cloud_stands_still_[static_cast<std::size_t>(answer.source)];
  const PlaceMotion& place = motions_[static_cast<std::size_t>(source)].place;
  // A map that moves is measured anew at each place.
  if (whole.boxes && !place.stands_still(time_)) {
    return {source, obstacles_key({&whole}) ^ place.key(), time_, stands_still};
  }
  return {source, obstacles_key({&whole}), whole.stamp, stands_still};
}

int CloudSelection::source_of(const LinkProximity& answer, bool is_world) const {
  const std::vector<int>& sources = is_world ? world_sources_ : cloud_sources_;
  const auto number = static_cast<std::size_t>(answer.source);
  return answer.source < 0 || number >= sources.size() ? -1 : sources[number];
}

void CloudSelection::list_zones(std::vector<std::string>* names) const {
  names->clear();
  for (const SourceSnapshot* snapshot : selected_) {
    if (!snapshot) continue;
    for (const auto& zone : snapshot->zones) {
      const std::string& name = zone->config().name;
      if (std::find(names->begin(), names->end(), name) == names->end()) names->push_back(name);
    }
  }
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
