#include "ist_proximity/facade/cost.h"

#include <time.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>

#include "ist_proximity/repulsion/kept_repulsion.h"

namespace ist {
namespace {

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

}  // namespace

CycleCost measure_cycles(const Robot& robot, Span<const double> q,
                         const std::vector<Obstacles>& scenes, int per_cloud,
                         const QueryConfig& query_config, const RepulsionConfig& repulsion_config) {
  if (scenes.empty() || per_cloud < 1) {
    throw std::invalid_argument("cycles are measured with at least one scene, each for a cycle");
  }
  const std::size_t joints = robot.joints().size(), links = robot.links().size();
  if (joints == 0 || q.size() % joints != 0) {
    throw std::invalid_argument("a configuration has one position for each of the robot's joints");
  }
  ProximityQuery query(robot.model(), query_config);
  const Repulsion repulsion(robot.model());
  std::vector<KeptRepulsion> blends;  // as the node keeps them
  for (std::size_t i = 0; i < links; ++i) blends.emplace_back(i);
  std::vector<LinkProximity> answers(links);
  CycleCost cost;
  for (std::size_t k = 0; k * joints < q.size(); ++k) {
    const LinkPoses poses = robot.link_poses({q.data() + k * joints, joints});
    const std::size_t cloud = k / static_cast<std::size_t>(per_cloud);
    const CloudSnapshot* scene = &scenes[cloud % scenes.size()].snapshot();
    const double begin = thread_time();
    query.run(poses.X_FL, poses.known, {scene}, &answers);
    const double middle = thread_time();
    for (std::size_t i = 0; i < links; ++i) {
      blends[i].update(repulsion, poses.X_FL[i], {scene}, answers[i], repulsion_config);
    }
    cost.query.push_back(middle - begin);
    cost.repulsion.push_back(thread_time() - middle);
    add_answers(answers, &cost);
  }
  return cost;
}

}  // namespace ist
