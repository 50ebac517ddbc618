#include "ist_proximity/facade/cost.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <future>
#include <limits>
#include <memory>
#include <stdexcept>
#include <thread>

#include "ist_proximity/repulsion/kept_repulsion.h"
#include "obstacle_ingest.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLongestPeriod = 10.0;  // [s] a longer one is a mistake in the unit

/// [s] Processor time of this thread: what other programs take does not count.
double thread_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void add_answers(const std::vector<LinkProximity>& answers, CycleCost* cost) {
  double width = 0.0, smallest = std::numeric_limits<double>::infinity();
  int unknown = 0;
  for (const LinkProximity& answer : answers) {
    if (answer.state == LinkState::kUnknown) {
      ++unknown;
      smallest = -std::numeric_limits<double>::infinity();
      continue;
    }
    if (answer.state == LinkState::kClear) continue;
    if (answer.state == LinkState::kNear) {
      width = std::max(width, answer.distance - answer.lower_bound);
    }
    smallest = std::min(smallest, answer.lower_bound);
  }
  cost->width.push_back(width);
  cost->smallest.push_back(smallest);
  cost->unknown.push_back(unknown);
}

/// The same cloud again and again, as a node gets the clouds of a camera.
class CloudStream {
 public:
  CloudStream(const RawCloud& cloud, const ObstaclesConfig& config)
      : cloud_(cloud), ingest_(config) {}

  /// The next cloud; valid until the call after the next one.
  const CloudSnapshot& next() {
    newest_ = (newest_ + 1) % snapshots_.size();
    // Another thread, so that the indexed points are in its processor's caches and not in ours.
    std::async(std::launch::async, [this] { ingest(&snapshots_[newest_]); }).get();
    return snapshots_[newest_];
  }

 private:
  void ingest(CloudSnapshot* snapshot) {
    RawCloud message = cloud_;
    if (cloud_.size() > 0) {
      const std::size_t size = (cloud_.height - 1) * cloud_.row_step +
                               (cloud_.width - 1) * cloud_.point_step +
                               3 * (cloud_.is_double ? sizeof(double) : sizeof(float));
      auto bytes = std::make_shared<std::vector<std::uint8_t>>(cloud_.data, cloud_.data + size);
      message.data = bytes->data();
      message.owner = std::move(bytes);
    }
    ingest_.run(message, snapshot);
  }

  RawCloud cloud_;
  ObstacleIngest ingest_;
  // The node has as many: one is in use, the next is filled, and its memory is used again.
  std::array<CloudSnapshot, 3> snapshots_;
  std::size_t newest_ = 0;
};

}  // namespace

CycleCost measure_cycles(const Robot& robot, Span<const double> q, const RawCloud& cloud,
                         const ObstaclesConfig& obstacles, const CycleConfig& config) {
  if (config.per_cloud < 1 || !(config.period >= 0.0 && config.period <= kLongestPeriod)) {
    throw std::invalid_argument("per_cloud is at least 1, and period 0 to 10 s");
  }
  const std::size_t joints = robot.joints().size(), links = robot.links().size();
  if (joints == 0 || q.size() % joints != 0) {
    throw std::invalid_argument("a configuration has one position for each of the robot's joints");
  }
  CloudStream stream(cloud, obstacles);
  ProximityQuery query(robot.model(), config.query);
  const Repulsion repulsion(robot.model());
  std::vector<KeptRepulsion> blends;  // as the node keeps them
  for (std::size_t i = 0; i < links; ++i) blends.emplace_back(i);
  std::vector<LinkProximity> answers(links);
  const CloudSnapshot* snapshot = nullptr;
  CycleCost cost;
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config.period));
  Clock::time_point start = Clock::now();
  for (std::size_t k = 0; k * joints < q.size(); ++k) {
    const LinkPoses poses = robot.link_poses({q.data() + k * joints, joints});
    if (k % static_cast<std::size_t>(config.per_cloud) == 0) snapshot = &stream.next();
    if (config.period > 0.0) {
      start = std::max(start + period, Clock::now());
      std::this_thread::sleep_until(start);
    }
    const double begin = thread_time();
    query.run(poses.X_FL, poses.known, {snapshot}, &answers);
    const double middle = thread_time();
    for (std::size_t i = 0; i < links; ++i) {
      blends[i].update(repulsion, poses.X_FL[i], {snapshot}, answers[i], config.repulsion);
    }
    cost.query.push_back(middle - begin);
    cost.repulsion.push_back(thread_time() - middle);
    add_answers(answers, &cost);
  }
  return cost;
}

}  // namespace ist
