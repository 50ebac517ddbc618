#include "ros/input/snapshot_exchange.h"

#include <atomic>

namespace ist {

namespace {

using SnapshotPtr = std::shared_ptr<SourceSnapshot>;

// Whether there is a snapshot that its slot alone holds.
bool is_unused(const SnapshotPtr& snapshot) {
  if (!snapshot || snapshot.use_count() > 1) return false;
  // use_count() alone does not order what the last holder read before what is written now.
  std::atomic_thread_fence(std::memory_order_acquire);
  return true;
}

// Lets go of what a snapshot keeps alive, but not of its own memory.
void empty(SourceSnapshot* snapshot) {
  snapshot->cloud.index.clear();
  snapshot->cloud.boxes.reset();
  for (CloudSnapshot& cloud : snapshot->in_zones) cloud.index.clear();
  snapshot->memory.reset();
  snapshot->model.reset();
}

}  // namespace

void add_clouds(const SourceSnapshot& snapshot, std::vector<const CloudSnapshot*>* clouds) {
  clouds->push_back(&snapshot.cloud);
  for (const CloudSnapshot& cloud : snapshot.in_zones) {
    if (!cloud.index.empty() && !cloud.not_for.empty()) clouds->push_back(&cloud);
  }
}

std::string ended_zone(const SourceSnapshot& snapshot, const ros::Time& now) {
  for (const std::shared_ptr<const LiveZone>& zone : snapshot.zones) {
    if (zone->is_on(now)) continue;
    return "zone '" + zone->config().name +
           "' has left points out of it and has ended: the next one is waited for";
  }
  return "";
}

SourceSnapshot& SnapshotExchange::writable() {
  SnapshotPtr& back = this->back();
  SnapshotPtr* const waiting = this->waiting();
  if (waiting != nullptr && !is_unused(back) && is_unused(*waiting)) back.swap(*waiting);
  spare_age_ = waiting != nullptr ? spare_age_ + 1 : 0;
  if (!is_unused(back)) back = std::make_shared<SourceSnapshot>();
  return *back;
}

bool SnapshotExchange::release_unused() {
  SnapshotPtr* const waiting = this->waiting();
  if (waiting == nullptr) return false;
  SnapshotPtr& back = this->back();
  if (is_unused(back) && is_unused(*waiting) && spare_age_ >= kSpareAge) waiting->reset();
  for (SnapshotPtr* slot : {&back, waiting}) {
    if (is_unused(*slot)) empty(slot->get());
  }
  return true;
}

}  // namespace ist
