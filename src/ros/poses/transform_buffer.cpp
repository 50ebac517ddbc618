#include "ros/poses/transform_buffer.h"

#include <ros/console.h>

#include <algorithm>
#include <boost/function.hpp>
#include <exception>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr std::chrono::seconds kMemory(1);
constexpr int kGoodEnough = 2;  // transforms after a refused one: one may be of every other
constexpr std::size_t kMaxFrames = 10000;  // a limit of memory; robots have some hundred
constexpr std::size_t kMaxDepth = 1000;    // tf's own

}  // namespace

void TransformBuffer::subscribe(ros::NodeHandle nh) {
  const auto hints = ros::TransportHints().tcpNoDelay();
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;
  using Callback = boost::function<void(const Event&)>;
  const Callback receive_moving = [this](const Event& event) { receive(event, false); };
  const Callback receive_static = [this](const Event& event) { receive(event, true); };
  moving_ = nh.subscribe<tf2_msgs::TFMessage, const Event&>("/tf", 100, receive_moving, {}, hints);
  static_ =
      nh.subscribe<tf2_msgs::TFMessage, const Event&>("/tf_static", 100, receive_static, {}, hints);
}

void TransformBuffer::receive(const ros::MessageEvent<const tf2_msgs::TFMessage>& event,
                              bool is_static) {
  notice_clock_jump();
  const ros::Time now = ros::Time::now();
  const TransformPublisher publisher(event.getPublisherName(), event.getConnectionHeaderPtr());
  for (const auto& transform : event.getConstMessage()->transforms) {
    if (is_ignored(transform.child_frame_id)) {
      if (is_static) compare(transform, publisher, now);
      continue;
    }
    const std::string problem = add(transform, publisher, is_static, now);
    if (!problem.empty()) ROS_WARN_STREAM_THROTTLE(5.0, problem);
  }
  const std::string skew = ahead();
  if (!skew.empty()) ROS_WARN_STREAM_THROTTLE(60.0, skew);
}

void TransformBuffer::ignore(const std::vector<std::string>& child_frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ignored_ = {child_frames.begin(), child_frames.end()};
}

bool TransformBuffer::is_ignored(const std::string& child_frame) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !ignored_.empty() && ignored_.count(without_slash(child_frame)) > 0;
}

void TransformBuffer::notice_clock_jump() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    ROS_WARN("the ROS clock jumped back by %.3f s: transforms and clouds from before are dropped",
             seconds_between(now, last_now_));
    forget_moving();
  }
  last_now_ = now;
}

void TransformBuffer::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  forget_moving();
}

/// The caller holds mutex_.
void TransformBuffer::forget_moving() {
  tf2::BufferCore::clear();
  for (auto entry = records_.begin(); entry != records_.end();) {
    Record& record = entry->second;
    Record kept;
    kept.parent = record.parent;
    if (record.is_refused_for_good()) {
      kept.refusal = record.refusal;
      kept.refused_until = record.refused_until;
    }
    gaps_ -= record.gaps.size();
    record.statements.forget_moving();
    kept.newest_static = record.newest_static;
    kept.static_change = record.static_change;
    kept.is_static_in_tf = record.is_static_in_tf;
    kept.frozen = record.frozen;
    if (kept.refusal.empty() && record.statements.empty() && !kept.is_static_in_tf) {
      if (!record.statements.dispute().empty()) --disputes_;
      entry = records_.erase(entry);
      continue;
    }
    kept.statements = std::move(record.statements);  // end_disputes() compares them again
    record = std::move(kept);
    ++entry;
  }
  any_ahead_ = false;
}

/// Says why a transform cannot be used, whatever the others are; empty: it can.
std::string TransformBuffer::why_unusable(const geometry_msgs::TransformStamped& transform,
                                          bool is_static, const ros::Time& now) {
  const std::string child = without_slash(transform.child_frame_id);
  const std::string parent = without_slash(transform.header.frame_id);
  if (child.empty() || parent.empty()) return "names no frame";
  if (child == parent) return "leads from a frame to itself";
  Eigen::Isometry3d ignored;
  const std::string fault = to_isometry(transform.transform, &ignored);
  if (!fault.empty()) return "is not used: " + fault;
  if (is_static) return "";
  if (transform.header.stamp.isZero()) {
    return "has no stamp (0) and is not used: the publisher must set header.stamp";
  }
  const double ahead = seconds_between(now, transform.header.stamp);
  if (ahead > kMaxAhead) {
    return format_text("is stamped %.2f s in the future and not used: compare the clocks", ahead);
  }
  return "";
}

std::string TransformBuffer::add(const geometry_msgs::TransformStamped& transform,
                                 const TransformPublisher& publisher, bool is_static,
                                 const ros::Time& now) {
  std::string fault = why_unusable(transform, is_static, now);
  if (fault.empty()) {
    bool is_new = true;
    const std::lock_guard<std::mutex> lock(mutex_);
    fault = note(transform, publisher, is_static, now, &is_new);
    try {
      const bool is_refused =
          fault.empty() && is_new && !setTransform(transform, publisher.name, is_static);
      if (is_refused) fault = "is not used: tf refuses it";
    } catch (const std::exception& error) {
      fault = std::string("is not used: ") + error.what();
    }
  }
  return fault.empty() ? "" : refuse(transform, publisher.name, fault, is_static);
}

/// Notes a transform in the record of its frame. The caller holds mutex_.
/// @param is_new  receives false where tf has it already, and would log it, and for joint states,
///                which have no connection here, where they are not in order
/// @returns empty, or why it cannot be used beside the others
std::string TransformBuffer::note(const geometry_msgs::TransformStamped& transform,
                                  const TransformPublisher& publisher, bool is_static,
                                  const ros::Time& now, bool* is_new) {
  Record* record = find_or_make(without_slash(transform.child_frame_id));
  if (!record) return format_text("is not used: there are %zu frames", kMaxFrames);
  change_statements([&](FrameStatements* all) { all->add(transform, publisher, is_static, now); },
                    record);
  note_turn(transform, publisher, is_static, record);
  const ros::Time& stamp = transform.header.stamp;
  const double behind = seconds_between(stamp, record->newest);
  if (!is_static && !record->newest.isZero() && behind > getCacheLength().toSec()) {
    return format_text(
        "is not used: its stamp is %.2f s behind that of another one; are there two publishers, "
        "with two clocks?",
        behind);
  }
  if (record->is_refused_for_good()) {  // tf has another one now
    record->refusal.clear();
    record->refused_until = Clock::time_point();
    --lasting_refusals_;
  }
  if (is_static) return "";
  record->parent = without_slash(transform.header.frame_id);
  *is_new = publisher.has_connection ? stamp != record->newest : stamp > record->newest;
  if (*is_new) note_gap(transform, record);
  if (stamp <= record->newest) return "";
  record->newest = stamp;
  record->received = now;
  record->ahead = seconds_between(now, stamp);
  any_ahead_ = any_ahead_ || record->ahead > kClockResolution;
  if (record->ahead >= kToldSkew) record->ahead_until = Clock::now() + kMemory;
  // A publisher that sends good ones again is not refused any more.
  if (!record->is_refused_for_good() && record->refused_publisher == publisher.name &&
      ++record->good_since >= kGoodEnough) {
    record->refusal.clear();
  }
  return "";
}

/// The caller holds mutex_.
void TransformBuffer::note_gap(const geometry_msgs::TransformStamped& transform, Record* record) {
  gaps_ -= record->gaps.size();
  record->gaps.note(transform, longest_gap_, getCacheLength().toSec());
  gaps_ += record->gaps.size();
}

/// The caller holds mutex_.
void TransformBuffer::note_static_change(Record* record) {
  record->static_change = ++static_changes_;
}

/// Notes whether tf2 has a frame without time, and whether it moves all the same. The caller holds
/// mutex_.
void TransformBuffer::note_turn(const geometry_msgs::TransformStamped& transform,
                                const TransformPublisher& publisher, bool is_static,
                                Record* record) {
  if (is_static) {
    geometry_msgs::TransformStamped& newest = record->newest_static;
    const bool is_same = newest.transform == transform.transform &&
                         newest.header.frame_id == transform.header.frame_id;
    if (!newest.child_frame_id.empty() && !is_same) note_static_change(record);
    newest = transform;
    record->is_static_in_tf = record->is_static_in_tf || record->newest.isZero();
    if (!record->frozen.empty()) --disputes_;
    return record->frozen.clear();
  }
  if (!record->is_static_in_tf || !record->frozen.empty() ||
      !record->statements.statics().empty()) {
    return;
  }
  ++disputes_;
  record->frozen = "the transform from '" + without_slash(transform.child_frame_id) + "' to '" +
                   without_slash(transform.header.frame_id) + "' was static, and " +
                   publisher.name + " moves it now: start this node again";
}

/// The record of a frame; null where there are too many. The caller holds mutex_.
TransformBuffer::Record* TransformBuffer::find_or_make(const std::string& child) {
  const auto found = records_.find(child);
  if (found != records_.end()) return &found->second;
  return records_.size() < kMaxFrames ? &records_[child] : nullptr;
}

std::string TransformBuffer::refuse(const geometry_msgs::TransformStamped& transform,
                                    const std::string& publisher, const std::string& fault,
                                    bool is_static) {
  const std::string child = without_slash(transform.child_frame_id);
  const std::string parent = without_slash(transform.header.frame_id);
  const std::lock_guard<std::mutex> lock(mutex_);
  last_refusal_ = "the transform from '" + child + "' to '" + parent + "' of ";
  last_refusal_ += publisher + " " + fault;
  refused_until_ = Clock::now() + kMemory;
  Record* record = find_or_make(child);
  if (!record) return last_refusal_;
  record->parent = parent;
  record->refusal = last_refusal_;
  record->refused_publisher = publisher;
  record->good_since = 0;
  if (record->is_refused_for_good()) return last_refusal_;
  if (is_static) ++lasting_refusals_;
  record->refused_until = is_static ? Clock::time_point::max() : refused_until_.load();
  return last_refusal_;
}

/// Changes what is said of a frame, counts the disputes, and gives tf the static transform that is
/// left at the end of one. The caller holds mutex_.
template <typename Change>
void TransformBuffer::change_statements(const Change& change, Record* record) {
  FrameStatements& statements = record->statements;
  const bool was_disputed = !statements.dispute().empty();
  change(&statements);
  const bool is_disputed = !statements.dispute().empty();
  if (is_disputed && !was_disputed) ++disputes_;
  if (is_disputed || !was_disputed) return;
  --disputes_;
  for (const auto& left : statements.statics()) {
    note_static_change(record);
    setTransform(left, "", true);
  }
}

void TransformBuffer::compare(const geometry_msgs::TransformStamped& transform,
                              const TransformPublisher& publisher, const ros::Time& now) {
  if (!why_unusable(transform, true, now).empty()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = records_.find(without_slash(transform.child_frame_id));
  if (found == records_.end() || found->second.statements.statics().empty()) return;
  change_statements([&](FrameStatements* all) { all->add(transform, publisher, true, now); },
                    &found->second);
}

void TransformBuffer::withdraw(const std::string& publisher) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& [child, record] : records_) record.statements.withdraw(publisher);
}

void TransformBuffer::end_disputes(const ros::Time& now) {
  if (disputes_ == 0) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& [child, record] : records_) {
    if (record.statements.dispute().empty()) continue;
    change_statements([&](FrameStatements* all) { all->decide(now); }, &record);
  }
}

std::string TransformBuffer::problem() const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (Clock::now() < refused_until_.load()) return last_refusal_;
    for (const auto& [child, record] : records_) {
      if (record.is_refused_for_good()) return record.refusal;
    }
  }
  return ahead();
}

std::string TransformBuffer::ahead() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!any_ahead_) return "";
  const auto now = Clock::now();
  const std::pair<const std::string, Record>* farthest = nullptr;
  for (const auto& entry : records_) {
    if (entry.second.ahead < kToldSkew || now > entry.second.ahead_until) continue;
    if (!farthest || entry.second.ahead > farthest->second.ahead) farthest = &entry;
  }
  if (!farthest) return "";
  return "the transform from '" + farthest->first + "' to '" + farthest->second.parent +
         format_text("' is stamped %.3f s ahead of the clock", farthest->second.ahead) +
         ": its age counts from its receipt; compare the clocks";
}

/// The frames from `frame` up to `end` or to the root, `end` excluded. The caller holds mutex_.
/// @returns whether `end` was reached
bool TransformBuffer::way_up(const std::string& end, const std::string& frame,
                             std::vector<std::string>* way) const {
  way->clear();
  std::string at = frame, parent;
  while (at != end && !at.empty() && way->size() < kMaxDepth) {
    way->push_back(at);
    const auto record = records_.find(at);
    if (_getParent(at, ros::Time(), parent)) {
      at = parent;
    } else if (record != records_.end()) {
      at = record->second.parent;  // every transform has been refused
    } else {
      break;
    }
  }
  return at == end;
}

/// What is known of all transforms between two frames. The caller holds mutex_.
std::vector<const TransformBuffer::Record*> TransformBuffer::between(
    const std::string& fixed_frame, const std::string& frame) const {
  const std::string fixed = without_slash(fixed_frame), other = without_slash(frame);
  std::vector<std::string> way, from_fixed;
  if (!way_up(fixed, other, &way)) {
    if (way_up(other, fixed, &from_fixed)) way.clear();
    // The transforms above the frame that both are below do not matter.
    while (!way.empty() && !from_fixed.empty() && way.back() == from_fixed.back()) {
      way.pop_back();
      from_fixed.pop_back();
    }
  }
  way.insert(way.end(), from_fixed.begin(), from_fixed.end());
  std::vector<const Record*> records;
  for (const std::string& child : way) {
    const auto record = records_.find(child);
    if (record != records_.end()) records.push_back(&record->second);
  }
  return records;
}

std::string TransformBuffer::why_refused(const std::string& fixed, const std::string& frame) const {
  const auto now = Clock::now();
  if (now >= refused_until_.load() && lasting_refusals_ == 0) return "";
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Record* record : between(fixed, frame)) {
    if (now < record->refused_until && !record->refusal.empty()) return record->refusal;
  }
  return "";
}

std::string TransformBuffer::dispute(const std::string& fixed, const std::string& frame) const {
  if (disputes_ == 0) return "";
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Record* record : between(fixed, frame)) {
    const std::string& dispute = record->statements.dispute();
    if (!dispute.empty()) return dispute;
    if (!record->frozen.empty()) return record->frozen;
  }
  return "";
}

std::uint64_t TransformBuffer::static_changes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return static_changes_;
}

bool TransformBuffer::has_static_change(const std::string& fixed, const std::string& frame,
                                        std::uint64_t since) const {
  if (static_changes_ == since) return false;
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::vector<const Record*> way = between(fixed, frame);
  return std::any_of(way.begin(), way.end(),
                     [since](const Record* record) { return record->static_change > since; });
}

std::string TransformBuffer::gap(const std::string& fixed, const std::string& frame,
                                 const ros::Time& instant) const {
  if (gaps_ == 0) return "";
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Record* record : between(fixed, frame)) {
    const TransformGaps::Gap* gap = record->gaps.find(instant);
    if (gap == nullptr) continue;
    return "no transform from '" + frame + "' to '" + fixed + "' at the time: one to '" +
           record->parent +
           format_text(
               "' was silent for %.2f s and has moved meanwhile, allowed is %.2f s "
               "(~pose_timeout)",
               seconds_between(gap->begin, gap->end), longest_gap_);
  }
  return "";
}

ros::Time TransformBuffer::counts_from(const std::string& fixed, const std::string& frame,
                                       const ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ros::Time from = stamp;
  if (!any_ahead_) return from;
  for (const Record* record : between(fixed, frame)) {
    if (record->ahead > kClockResolution) from = std::min(from, record->received);
  }
  return from;
}

}  // namespace ist
