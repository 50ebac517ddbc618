#include "ros/input/unknown_space.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>

#include "ros/common/exceptions.h"
#include "ros/common/publish.h"
#include "ros/common/stopwatch.h"
#include "ros/common/text.h"
#include "ros/common/thread_name.h"
#include "ros/input/unseen_markers.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

// The robot may move so far [m] until the next look.
constexpr double kMotion = 0.5;
constexpr double kShortestPeriod = 0.1;  // [s]
// The thread looks for at most this share of its time.
constexpr double kWorkingShare = 0.25;
// One million boxes take 0.5 s and 150 MB. Where there are more, the region becomes smaller.
constexpr std::size_t kMaxBoxes = 1000000;
constexpr double kSmaller = 0.8;
constexpr std::chrono::milliseconds kMarkerPeriod(500);
// [s] Stamps are not so far ahead of the clock, unless it has gone back (see SourceMemory).
constexpr double kBeganAnew = 1.0;

}  // namespace

UnknownSpaceWatch::UnknownSpaceWatch(SourceMemories memories, double range,
                                     const ros::Publisher& publisher, double drawn_range,
                                     const TransformBuffer& buffer)
    : memories_(std::move(memories)),
      range_(range),
      publisher_(publisher),
      drawn_range_(drawn_range),
      buffer_(buffer) {
  for (const auto& memory : memories_) skin_ = std::max(skin_, memory->skin());
  thread_ = std::thread(&UnknownSpaceWatch::run, this);
}

UnknownSpaceWatch::~UnknownSpaceWatch() {
  stop_.stop();
  thread_.join();
}

const UnknownSnapshot* UnknownSpaceWatch::newest() {
  channel_.update();
  return channel_.front().get();
}

std::shared_ptr<const UnknownSnapshot> UnknownSpaceWatch::share() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return shared_;
}

std::string UnknownSpaceWatch::place(const UnknownSnapshot& unknown, const std::string& fixed_frame,
                                     const ros::Time& time, double max_age,
                                     Eigen::Isometry3d* X_FM) const {
  const double ahead = unknown.stamp - time.toSec();
  if (ahead > kBeganAnew) {
    return "all space counts as unknown: " +
           format_text("what was seen last is of %.2f s after the present", ahead);
  }
  const std::string problem =
      look_up_near(buffer_, fixed_frame, unknown.frame, time, max_age, X_FM, nullptr);
  return problem.empty() ? "" : "all space counts as unknown (memory/frame_id): " + problem;
}

void UnknownSpaceWatch::run() {
  name_thread("ist unknown");
  double wait = kShortestPeriod;
  const auto now = [] { return std::chrono::steady_clock::now(); };
  while (stop_.sleep_until(now() + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                       std::chrono::duration<double>(wait)))) {
    Stopwatch watch;
    std::shared_ptr<const UnknownSnapshot> snapshot;
    const std::string fault = exception_of([&] { snapshot = look(); });
    if (!fault.empty()) {
      ROS_ERROR_STREAM_THROTTLE(5.0, "unknown space could not be found: " << fault);
    }
    // Without a snapshot nothing counts as seen.
    channel_.back() = snapshot;
    channel_.publish();
    const std::lock_guard<std::mutex> lock(mutex_);
    shared_ = snapshot;
    wait = std::max(kShortestPeriod, watch.lap() / kWorkingShare);
  }
}

std::shared_ptr<const UnknownSnapshot> UnknownSpaceWatch::look() {
  auto snapshot = std::make_shared<UnknownSnapshot>();
  KnownSpace all;
  Eigen::AlignedBox3d robot;
  bool any = false;
  for (const auto& memory : memories_) {
    KnownSpace known;
    if (!memory->add_to(&snapshot->seen, &known)) continue;
    any = true;
    for (const Eigen::AlignedBox3d& link : known.links) robot.extend(link);
    all.links.insert(all.links.end(), known.links.begin(), known.links.end());
    snapshot->stamp = std::max(snapshot->stamp, known.stamp);
    all.frame = known.frame;
  }
  if (!any || robot.isEmpty()) return nullptr;
  double radius = 0.5 * robot.diagonal().norm() + range_ + kMotion;
  VoxelBoxes boxes;
  while (!snapshot->seen.unknown_boxes(robot.center(), radius, kMaxBoxes, &boxes)) {
    radius *= kSmaller;
  }
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes);
  snapshot->frame = all.frame;
  snapshot->boxes = index;
  snapshot->center_M = robot.center();
  snapshot->radius = radius;
  publish_when_due(boxes, all);
  return snapshot;
}

void UnknownSpaceWatch::publish_when_due(const VoxelBoxes& boxes, const KnownSpace& known) {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_publication_ || publisher_.getNumSubscribers() == 0) return;
  next_publication_ = now + kMarkerPeriod;
  std_msgs::Header header;  // its stamp is 0, so rviz takes the newest transform
  header.frame_id = known.frame;
  publish_message(publisher_, unseen_markers(boxes, known.links, drawn_range_, header));
}

}  // namespace ist
