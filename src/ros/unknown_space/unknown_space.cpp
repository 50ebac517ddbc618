#include "ros/unknown_space/unknown_space.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <limits>

#include "ros/common/eigen_conversion.h"
#include "ros/common/exceptions.h"
#include "ros/common/publish.h"
#include "ros/common/stopwatch.h"
#include "ros/common/text.h"
#include "ros/common/thread_name.h"

namespace ist {
namespace {

// The robot may move so far [m] until the next look.
constexpr double kMotion = 0.5;
constexpr double kShortestPeriod = 0.1;  // [s]
// The thread looks for at most this share of its time, unless what it finds would be too old.
constexpr double kWorkingShare = 0.25;
// A look holds for this share of a memory's decay, or so many seconds if that is more; all space
// counts as unknown afterwards.
constexpr double kHolds = 0.5, kHoldsAtLeast = 1.0;
// One million boxes take 0.5 s and 150 MB. Where there are more, the region becomes smaller.
constexpr std::size_t kMaxBoxes = 1000000;
constexpr double kSmaller = 0.8;
constexpr std::chrono::milliseconds kMarkerPeriod(500);
// [m] Unknown space is drawn as far from the links as this.
constexpr double kDrawnUnseen = 0.15;
// [s] Stamps are not so far ahead of the clock, unless it has gone back (see SourceMemory).
constexpr double kBeganAnew = 1.0;

using visualization_msgs::Marker;

constexpr std::size_t kMaxCubes = 20000;
constexpr double kLargestCube = 0.05;  // [m] Larger boxes are drawn in parts.
constexpr double kDrawnShare = 0.25;   // of the least edge, so that the robot is seen through them
constexpr double kGrey = 0.6;
constexpr double kOpacity = 0.8;  // of what touches a link; nothing is left at the range's end

std_msgs::ColorRGBA grey(double opacity) {
  std_msgs::ColorRGBA color;
  color.r = color.g = color.b = static_cast<float>(kGrey);
  color.a = static_cast<float>(opacity);
  return color;
}

struct Cube {
  Eigen::AlignedBox3d box;
  double distance;  ///< [m] to the nearest link's box
};

double distance_to(const VoxelBoxes& links, const Eigen::AlignedBox3d& box) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Eigen::AlignedBox3d& link : links) {
    smallest = std::min(smallest, link.exteriorDistance(box));
  }
  return smallest;
}

/// Halves a box along its longest side until its parts are small or far.
void append_parts(const Eigen::AlignedBox3d& box, const VoxelBoxes& links, double range,
                  std::vector<Cube>* cubes) {
  const double distance = distance_to(links, box);
  if (!(distance < range)) return;
  int side = 0;
  if (box.sizes().maxCoeff(&side) <= kLargestCube) {
    cubes->push_back({box, distance});
    return;
  }
  Eigen::AlignedBox3d low = box, high = box;
  low.max()[side] = high.min()[side] = box.center()[side];
  append_parts(low, links, range, cubes);
  append_parts(high, links, range, cubes);
}

}  // namespace

UnknownSpaceWatch::UnknownSpaceWatch(SourceMemories memories, double range,
                                     const ros::Publisher& publisher)
    : memories_(std::move(memories)), range_(range), publisher_(publisher) {
  for (const auto& memory : memories_) {
    skin_ = std::max(skin_, memory->skin());
    longest_ = std::min(longest_, std::max(kHolds * memory->decay(), kHoldsAtLeast));
  }
  thread_ = std::thread(&UnknownSpaceWatch::run, this);
}

UnknownSpaceWatch::~UnknownSpaceWatch() {
  stop_.stop();
  thread_.join();
}

visualization_msgs::MarkerArray unseen_markers(const VoxelBoxes& boxes, const VoxelBoxes& links,
                                               double range, const std_msgs::Header& header) {
  std::vector<Cube> cubes;
  for (const Eigen::AlignedBox3d& box : boxes) append_parts(box, links, range, &cubes);
  if (cubes.size() > kMaxCubes) {
    std::nth_element(cubes.begin(), cubes.begin() + kMaxCubes, cubes.end(),
                     [](const Cube& a, const Cube& b) { return a.distance < b.distance; });
    cubes.resize(kMaxCubes);
  }
  Marker marker;
  marker.header = header;
  marker.ns = "unseen";
  marker.type = Marker::CUBE_LIST;
  marker.action = cubes.empty() ? Marker::DELETE : Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.color = grey(kOpacity);
  double edge = kLargestCube;
  for (const Cube& cube : cubes) {
    edge = std::min(edge, cube.box.sizes().minCoeff());
    marker.points.emplace_back();
    assign(cube.box.center(), &marker.points.back());
    marker.colors.push_back(grey(kOpacity * (1.0 - cube.distance / range)));
  }
  marker.scale.x = marker.scale.y = marker.scale.z = kDrawnShare * edge;
  visualization_msgs::MarkerArray array;
  array.markers.push_back(std::move(marker));
  return array;
}

std::string why_unusable(const UnknownSnapshot& unknown, const RobotModel& robot,
                         const std::string& fixed_frame, const ros::Time& time) {
  if (unknown.frame != fixed_frame) {
    return "all space counts as unknown: the fixed frame is another one since it was seen";
  }
  if (!same_geometry(*unknown.robot, robot)) {
    return "all space counts as unknown: the robot is another one since it was seen";
  }
  if (time.toSec() - unknown.found > unknown.lasts) {
    return "all space counts as unknown: " +
           format_text(
               "what had been seen was found %.2f s ago, and memories forget meanwhile; "
               "lower ~max_distance or ~memory/max_range, or raise the resolution",
               time.toSec() - unknown.found);
  }
  const double ahead = unknown.stamp - time.toSec();
  if (ahead <= kBeganAnew) return "";
  return "all space counts as unknown: " +
         format_text("what was seen last is of %.2f s after the present", ahead);
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
    channel_.back() = std::move(snapshot);
    channel_.publish();
    const double took = watch.lap();
    // The next look takes as long, and what was found has to hold until then.
    const double left = longest_ - 2.0 * took;
    wait = std::max(kShortestPeriod, std::min(took / kWorkingShare, left));
    if (wait > left) part_ *= kSmaller;
    if (wait < kSmaller * kSmaller * left) part_ = std::min(part_ / kSmaller, 1.0);
  }
}

std::shared_ptr<const UnknownSnapshot> UnknownSpaceWatch::look() {
  auto snapshot = std::make_shared<UnknownSnapshot>();
  snapshot->found = ros::Time::now().toSec();
  snapshot->lasts = longest_;
  KnownSpace all;
  Eigen::AlignedBox3d robot;
  bool any = false;
  for (const auto& memory : memories_) {
    KnownSpace known;
    if (!memory->add_to(&snapshot->seen, &known)) continue;
    // One of them does not know yet of another robot or fixed frame.
    if (any && !(known.frame == all.frame && same_geometry(*known.robot, *all.robot)))
      return nullptr;
    any = true;
    for (const Eigen::AlignedBox3d& link : known.links) robot.extend(link);
    all.links.insert(all.links.end(), known.links.begin(), known.links.end());
    snapshot->stamp = std::max(snapshot->stamp, known.stamp);
    all.frame = known.frame;
    all.robot = known.robot;
  }
  if (!any || robot.isEmpty()) return nullptr;
  double radius = part_ * (0.5 * robot.diagonal().norm() + range_ + kMotion);
  VoxelBoxes boxes;
  while (!snapshot->seen.unknown_boxes(robot.center(), radius, kMaxBoxes, &boxes)) {
    radius *= kSmaller;
  }
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes);
  snapshot->frame = all.frame;
  snapshot->robot = all.robot;
  snapshot->boxes = index;
  snapshot->center_F = robot.center();
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
  publish_message(publisher_, unseen_markers(boxes, known.links, kDrawnUnseen, header));
}

}  // namespace ist
