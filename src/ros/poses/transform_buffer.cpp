#include "ros/poses/transform_buffer.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

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

// Where a static transform is stated twice, the numbers differ by their rounding only. [m, rad]
constexpr double kRounding = 1e-3;
// [s] A publisher that has been silent for so long has stopped: less than three periods for none.
constexpr double kSilence = 1.0, kUnknownSilence = 3.0, kMaxSilence = 10.0;
constexpr double kSilentPeriods = 3.0;

PublisherTrack::Values values_of(const geometry_msgs::Transform& transform) {
  const auto& p = transform.translation;
  const auto& q = transform.rotation;
  PublisherTrack::Values values;
  values << p.x, p.y, p.z, q.x, q.y, q.z, q.w;
  return values;
}

std::string title(const geometry_msgs::TransformStamped& transform) {
  return "the transform from '" + without_slash(transform.child_frame_id) + "' to '" +
         without_slash(transform.header.frame_id) + "' ";
}

std::string parent_of(const geometry_msgs::TransformStamped& transform) {
  return without_slash(transform.header.frame_id);
}

/// How far apart two poses are: [m] and [rad].
std::pair<double, double> apart(const geometry_msgs::Transform& one,
                                const geometry_msgs::Transform& other) {
  const PublisherTrack::Values a = values_of(one), b = values_of(other);
  const double cosine = std::min(1.0, std::abs(a.tail<4>().dot(b.tail<4>())));
  return {(a - b).head<3>().norm(), 2.0 * std::acos(cosine)};
}

}  // namespace

std::string TransformBuffer::check(const geometry_msgs::TransformStamped& transform, bool is_static,
                                   const ros::Time& now) const {
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

std::string TransformBuffer::refuse(const geometry_msgs::TransformStamped& transform,
                                    const std::string& publisher, const std::string& fault,
                                    bool is_static) {
  std::string sentence = title(transform) + "of " + publisher + " " + fault;
  const std::lock_guard<std::mutex> lock(mutex_);
  last_refusal_ = sentence;
  last_refusal_time_ = Clock::now();
  const std::string child = without_slash(transform.child_frame_id);
  const auto found = records_.find(child);
  if (found == records_.end() && records_.size() >= kMaxFrames) return sentence;
  Record& record = found == records_.end() ? records_[child] : found->second;
  record.parent = without_slash(transform.header.frame_id);
  record.refusal = sentence;
  record.refused_publisher = publisher;
  record.good_since = 0;
  record.refusal_time = last_refusal_time_.load();
  if (is_static && !record.refusal_stays) ++lasting_refusals_;
  record.refusal_stays = record.refusal_stays || is_static;
  return sentence;
}

/// Forgets why a publisher's earlier transforms were refused once it sends good ones. The caller
/// holds mutex_.
void TransformBuffer::note_good(const std::string& publisher, Record* record) {
  if (record->refusal_stays || record->refused_publisher != publisher) return;
  if (++record->good_since >= kGoodEnough) record->refusal.clear();
}

/// Forgets why an earlier transform of a frame was refused, since tf has another now.
void TransformBuffer::accept(const std::string& child) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (lasting_refusals_ == 0) return;
  const auto record = records_.find(child);
  if (record == records_.end() || !record->second.refusal_stays) return;
  record->second.refusal.clear();
  record->second.refusal_stays = false;
  --lasting_refusals_;
}

std::string TransformBuffer::add(const geometry_msgs::TransformStamped& transform,
                                 const Publisher& publisher, bool is_static, const ros::Time& now) {
  const std::string fault = check(transform, is_static, now);
  if (!fault.empty()) return refuse(transform, publisher.name, fault, is_static);
  const std::string child = without_slash(transform.child_frame_id);
  std::unique_lock<std::mutex> lock(mutex_);
  const auto found = records_.find(child);
  if (found == records_.end() && records_.size() >= kMaxFrames) {
    lock.unlock();
    return refuse(transform, publisher.name,
                  format_text("is not used: there are %zu frames", kMaxFrames), is_static);
  }
  Record& record = found == records_.end() ? records_[child] : found->second;
  note_statement(transform, publisher, is_static, now, &record);
  if (!is_static) {
    const ros::Time& stamp = transform.header.stamp;
    record.parent = without_slash(transform.header.frame_id);
    // tf2 would log these: sent twice, or older than what it keeps.
    if (stamp == record.newest) return "";
    const double behind = seconds_between(stamp, record.newest);
    if (!record.newest.isZero() && behind > getCacheLength().toSec()) {
      lock.unlock();
      return refuse(transform, publisher.name,
                    format_text("is not used: its stamp is %.2f s behind that of another "
                                "one; are there two publishers, with two clocks?",
                                behind),
                    is_static);
    }
    if (stamp > record.newest) {
      record.newest = stamp;
      record.received = now;
      record.ahead = seconds_between(now, stamp);
      any_ahead_ = any_ahead_ || record.ahead > kClockResolution;
      if (record.ahead >= kToldSkew) record.ahead_time = skew_time_ = Clock::now();
      note_good(publisher.name, &record);
    }
  }
  lock.unlock();
  std::string problem;
  try {
    if (setTransform(transform, publisher.name, is_static)) {
      accept(child);
      return "";
    }
    problem = "is not used: tf refuses it";
  } catch (const std::exception& error) {
    problem = std::string("is not used: ") + error.what();
  }
  return refuse(transform, publisher.name, problem, is_static);
}

void TransformBuffer::compare(const geometry_msgs::TransformStamped& transform,
                              const Publisher& publisher, const ros::Time& now) {
  if (!check(transform, true, now).empty()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = records_.find(without_slash(transform.child_frame_id));
  if (found == records_.end()) return;
  const auto& statements = found->second.statements;
  const bool is_static = std::any_of(statements.begin(), statements.end(),
                                     [](const Statement& one) { return one.is_static; });
  if (is_static) note_statement(transform, publisher, true, now, &found->second);
}

void TransformBuffer::withdraw(const std::string& publisher) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& [child, record] : records_) {
    auto& statements = record.statements;
    statements.erase(
        std::remove_if(statements.begin(), statements.end(),
                       [&](const Statement& one) { return one.publisher.name == publisher; }),
        statements.end());
  }
}

/// Notes what a publisher says of a frame, and whether another one says otherwise. The caller holds
/// mutex_.
void TransformBuffer::note_statement(const geometry_msgs::TransformStamped& transform,
                                     const Publisher& publisher, bool is_static,
                                     const ros::Time& now, Record* record) {
  auto& statements = record->statements;
  auto own = std::find_if(statements.begin(), statements.end(), [&](const Statement& one) {
    return one.publisher.name == publisher.name;
  });
  double silence = kUnknownSilence;
  if (own == statements.end()) {
    own = statements.insert(own, {publisher, is_static, transform, now});
  } else {
    const double period = seconds_between(own->received, now);
    if (!own->is_static) silence = std::clamp(kSilentPeriods * period, kSilence, kMaxSilence);
    own->publisher.connection = publisher.connection;
    own->is_static = is_static;
    own->transform = transform;
    own->received = now;
  }
  own->silence = silence;
  std::string other;
  PublisherTrack::Values ignored;
  if (!is_static && record->track.add(publisher.name, transform.header.stamp,
                                      values_of(transform.transform), &other, &ignored)) {
    for (const Statement& one : statements) {
      if (one.publisher.name == other) silence = std::max(silence, one.silence);
    }
    record->rivals = {other, publisher.name};
    record->rivals_until = std::max(record->rivals_until, now + ros::Duration(silence));
  }
  if (statements.size() > 1) compare_statements(now, record);
}

/// @param rivals  the names of two whose motions differ
std::string TransformBuffer::why_disagreeing(const Statement& a, const Statement& b,
                                             const std::array<std::string, 2>& rivals) {
  const std::string parent_a = parent_of(a.transform), parent_b = parent_of(b.transform);
  const std::string names = a.publisher.name + " and " + b.publisher.name;
  if (parent_a != parent_b) {
    return "frame '" + without_slash(a.transform.child_frame_id) +
           "' has two publishers that disagree, " + names + ": its parent is '" + parent_a +
           "' or '" + parent_b + "'";
  }
  const auto [distance, angle] = apart(a.transform.transform, b.transform.transform);
  const bool are_rivals =
      std::find(rivals.begin(), rivals.end(), a.publisher.name) != rivals.end() &&
      std::find(rivals.begin(), rivals.end(), b.publisher.name) != rivals.end();
  const bool is_static = a.is_static || b.is_static;
  if (!are_rivals && !(is_static && std::max(distance, angle) > kRounding)) return "";
  return title(a.transform) + "has two publishers that disagree, " + names +
         format_text(": they are %.3f m apart", distance) +
         (angle > kRounding ? format_text(" and turned by %.2f deg", angle * 180.0 / M_PI) : "");
}

/// Forgets publishers that say nothing any more, and finds the first two that disagree. The caller
/// holds mutex_.
void TransformBuffer::compare_statements(const ros::Time& now, Record* record) {
  static const std::array<std::string, 2> none;
  auto& statements = record->statements;
  const auto is_over = [&](const Statement& one) {
    return one.is_static ? one.publisher.is_gone()
                         : seconds_between(one.received, now) > one.silence;
  };
  // Where all are over, tf has what came last.
  const bool all_over = std::all_of(statements.begin(), statements.end(), is_over);
  const Statement last = *std::max_element(
      statements.begin(), statements.end(),
      [](const Statement& x, const Statement& y) { return x.received < y.received; });
  statements.erase(std::remove_if(statements.begin(), statements.end(), is_over), statements.end());
  if (all_over) statements.push_back(last);
  std::string dispute;
  for (auto b = statements.begin(); b != statements.end() && dispute.empty(); ++b) {
    for (auto a = statements.begin(); a != b && dispute.empty(); ++a) {
      dispute = why_disagreeing(*a, *b, now < record->rivals_until ? record->rivals : none);
    }
  }
  // The numbers of a dispute that lasts stay those of its beginning, so that its text does.
  if (dispute.empty() == record->dispute.empty()) return;
  if (!dispute.empty()) {
    dispute += format_text(", since %.1f s; stop one of them", now.toSec());
    return set_dispute(dispute, record);
  }
  set_dispute("", record);
  for (const Statement& one : statements) {
    if (one.is_static) setTransform(one.transform, one.publisher.name, true);
  }
}

/// The caller holds mutex_.
void TransformBuffer::set_dispute(const std::string& dispute, Record* record) {
  if (record->dispute.empty() && !dispute.empty()) ++disputes_;
  if (!record->dispute.empty() && dispute.empty()) --disputes_;
  record->dispute = dispute;
}

void TransformBuffer::end_disputes(const ros::Time& now) {
  if (disputes_ == 0) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& [child, record] : records_) {
    if (record.dispute.empty()) continue;
    if (record.statements.empty()) {
      set_dispute("", &record);
    } else {
      compare_statements(now, &record);
    }
  }
}

void TransformBuffer::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  tf2::BufferCore::clear();
  for (auto entry = records_.begin(); entry != records_.end();) {
    Record& record = entry->second;
    Record kept;
    kept.parent = record.parent;
    if (record.refusal_stays) kept.refusal = record.refusal;
    kept.refusal_stays = record.refusal_stays;
    for (const Statement& one : record.statements) {
      if (!one.is_static) continue;
      kept.statements.push_back(one);
      kept.statements.back().received = ros::Time();
    }
    if (!kept.refusal_stays && kept.statements.empty()) {
      set_dispute("", &record);
      entry = records_.erase(entry);
      continue;
    }
    kept.dispute = record.dispute;  // compared again by end_disputes()
    record = std::move(kept);
    ++entry;
  }
  any_ahead_ = false;
}

std::string TransformBuffer::last_refusal() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (Clock::now() - last_refusal_time_.load() < kMemory) return last_refusal_;
  if (lasting_refusals_ == 0) return "";
  const auto record = std::find_if(records_.begin(), records_.end(),
                                   [](const auto& entry) { return entry.second.refusal_stays; });
  return record == records_.end() ? std::string() : record->second.refusal;
}

std::string TransformBuffer::ahead() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto now = Clock::now();
  if (now - skew_time_ > kMemory) return "";
  const std::pair<const std::string, Record>* farthest = nullptr;
  for (const auto& entry : records_) {
    if (entry.second.ahead < kToldSkew || now - entry.second.ahead_time > kMemory) continue;
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

/// The child frames of all transforms between two frames. The caller holds mutex_.
std::vector<std::string> TransformBuffer::between(const std::string& fixed_frame,
                                                  const std::string& frame) const {
  const std::string fixed = without_slash(fixed_frame), other = without_slash(frame);
  std::vector<std::string> way, from_fixed;
  if (way_up(fixed, other, &way)) return way;
  if (way_up(other, fixed, &from_fixed)) return from_fixed;
  // The transforms above the frame that both are below do not matter.
  while (!way.empty() && !from_fixed.empty() && way.back() == from_fixed.back()) {
    way.pop_back();
    from_fixed.pop_back();
  }
  way.insert(way.end(), from_fixed.begin(), from_fixed.end());
  return way;
}

std::string TransformBuffer::why_refused(const std::string& fixed, const std::string& frame) const {
  const auto now = Clock::now();
  if (now - last_refusal_time_.load() > kMemory && lasting_refusals_ == 0) return "";
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const std::string& child : between(fixed, frame)) {
    const auto record = records_.find(child);
    if (record == records_.end() || record->second.refusal.empty()) continue;
    if (record->second.refusal_stays || now - record->second.refusal_time < kMemory) {
      return record->second.refusal;
    }
  }
  return "";
}

std::string TransformBuffer::dispute(const std::string& fixed, const std::string& frame) const {
  if (disputes_ == 0) return "";
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const std::string& child : between(fixed, frame)) {
    const auto record = records_.find(child);
    if (record != records_.end() && !record->second.dispute.empty()) return record->second.dispute;
  }
  return "";
}

ros::Time TransformBuffer::counts_from(const std::string& fixed, const std::string& frame,
                                       const ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ros::Time from = stamp;
  if (!any_ahead_) return from;
  for (const std::string& child : between(fixed, frame)) {
    const auto record = records_.find(child);
    if (record == records_.end() || record->second.ahead <= kClockResolution) {
      continue;
    }
    from = std::min(from, record->second.received);
  }
  return from;
}

}  // namespace ist
