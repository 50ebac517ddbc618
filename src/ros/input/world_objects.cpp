// This part of WorldSource applies WorldObjects messages.

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/input/world_conversion.h"
#include "ros/input/world_source.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

}  // namespace

void WorldSource::receive(const ist_proximity::WorldObjects& message) {
  if (!running_) return;  // up to a thousand wait
  has_received_ = true;
  begin_work();
  guard(Kind::kMessage, [&] { apply(message); });
  end_work();
  note_receipt(message.header.stamp);
}

/// @param stamp  of the message; zero: it states none
void WorldSource::note_receipt(const ros::Time& stamp) {
  const ros::Time now = ros::Time::now();
  stamp_ = stamp.isZero() ? now : std::min(stamp, now);
  update([&](SourceReport* report) {
    ++report->messages;
    report->newest = stamp_.toSec();
  });
}

void WorldSource::apply(const ist_proximity::WorldObjects& message) {
  const std::size_t limit = config_.world.limits.max_objects;
  if (message.objects.size() > limit) {
    note_fault(fault_of(Kind::kMessage),
               "a message holds " + std::to_string(message.objects.size()) +
                   " objects; allowed are " + std::to_string(limit) + " (~sources/" + config_.name +
                   "/max_objects): it is not used");
    return show_faults();
  }
  faults_.erase(fault_of(Kind::kMessage));
  if (!message.replace_all) return change_all(message.objects);
  replace_from_topic([&] { change_all(message.objects); });
}

/// Removes the objects of the topic and adds others. Where these exceed a limit, all stays as it
/// was.
void WorldSource::replace_from_topic(const std::function<void()>& change) {
  WorldBuilder builder = builder_;
  std::set<std::string> from_topic = from_topic_;
  AttachedObjects attached = attached_;
  std::map<std::string, std::string> to_restate = to_restate_;
  WorldFaults faults = faults_;
  for (const std::string& name : from_topic_) {
    builder_.remove(name);
    to_restate_.erase(name);
    faults_.erase(object_fault(name));
  }
  from_topic_.clear();
  faults_.erase(fault_of(Kind::kMany));
  is_changed_ = true;
  change();
  const auto refused = faults_.find(fault_of(Kind::kMessage));
  if (refused == faults_.end()) return;
  // A limit is exceeded: the objects of before stay.
  faults[fault_of(Kind::kMessage)] = refused->second;
  builder_ = std::move(builder);
  from_topic_ = std::move(from_topic);
  attached_ = std::move(attached);
  to_restate_ = std::move(to_restate);
  faults_ = std::move(faults);
  show_faults();
}

/// Applies what a message says of one object; objects to add are collected, because many are built
/// faster together.
void WorldSource::change(const ist_proximity::WorldObject& message,
                         std::vector<WorldObject>* added) {
  using Message = ist_proximity::WorldObject;
  if (message.operation == Message::ADD) {
    remember_from_topic(message.id);
    added->push_back(to_world_object(message, config_.world, cancelled_));
    return;
  }
  if (!added->empty()) {  // in the order of the message
    add(Kind::kMessage, *added);
    added->clear();
  }
  is_changed_ = true;
  if (message.operation == Message::REMOVE) {
    builder_.remove(message.id);
    from_topic_.erase(message.id);
    faults_.erase(object_fault(message.id));
  } else if (message.operation == Message::MOVE) {
    const std::string fault =
        builder_.move(message.id, frame_of(message.header.frame_id), to_object_pose(message.pose));
    if (!fault.empty()) throw ModelError(fault);
    faults_.erase(object_fault(message.id));
  } else {
    throw ModelError("operation is " + std::to_string(message.operation) +
                     "; allowed is 0 (ADD), 1 (REMOVE), 2 (MOVE)");
  }
}

/// Notes that an object is removed when those of the topic are replaced. One that parameters, the
/// file or the other robot state as well stays, because nobody would send it again.
void WorldSource::remember_from_topic(const std::string& name) {
  // Names of objects that were never built are limited, too.
  const std::size_t most = 2 * config_.world.limits.max_objects;
  if (configured_.count(name) == 0 && from_topic_.size() < most) from_topic_.insert(name);
}

}  // namespace ist
