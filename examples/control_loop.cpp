// A loop at 1 kHz without ROS: clouds are indexed by one thread, distances are asked by another,
// which neither allocates nor locks nor waits for a cloud.
//
// Usage: control_loop robot.urdf scene.pcd
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <optional>
#include <thread>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/robot.h"

int main(int argc, char** argv) try {
  const ist::Robot robot(argc > 1 ? argv[1] : "robot.urdf");
  const ist::PointFile scene = ist::read_points(argc > 2 ? argv[2] : "scene.pcd");
  ist::SnapshotChannel<std::optional<ist::Obstacles>> newest;
  std::atomic<bool> stop{false};
  std::thread camera([&] {  // 30 images a second; here always the same one
    while (!stop) {
      newest.back().emplace(scene.points);
      newest.publish();
      std::this_thread::sleep_for(std::chrono::milliseconds(33));
    }
  });

  ist::ProximityQuery query(robot.model(), {});
  ist::ForwardKinematics forward(*robot.model(), robot.kinematics());
  const auto& joints = robot.kinematics()->joints();
  std::vector<double> q(joints.size(), std::nan(""));  // by joint; mimic joints follow at NaN
  ist::RobotProximity nearest;
  auto next = std::chrono::steady_clock::now();
  for (int cycle = 0; cycle < 1000; ++cycle) {
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (joints[i].is_free()) q[i] = 0.3 * std::sin(0.001 * cycle);
    }
    const auto& [X_FL, known] = forward.run(q);
    newest.update();  // until the first cloud, nothing is known
    if (newest.front()) query.run_minimum(X_FL, known, {&newest.front()->snapshot()}, &nearest);
    std::this_thread::sleep_until(next += std::chrono::milliseconds(1));
  }
  stop = true;
  camera.join();
  std::printf("at the end at least %.3f m\n", nearest.nearest.lower_bound);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
