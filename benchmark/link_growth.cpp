// How the cost of a cycle grows with the number of links: robots of 10, 20, 40 and 70 links before
// the synthetic image, an image each 33 ms and poses each millisecond, with the node's defaults.
//
// Seven arms of ten links stand at seven places. The small robots are one, two or four of these
// arms, and each arm is measured in as many robots of a size as any other: so robots of all sizes
// do the same work for each link, and cost the same a link if they grow well.
//
// One thread, processor time of that thread. Usage: link_growth CACHE_FOLDER [DOCUMENT];
// scripts/benchmark --links calls it.

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/kept_repulsion.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/scene.h"
#include "support.h"
#include "support/long_chain.h"
#include "support/whole_cloud.h"

namespace {

using ist::benchmark::Frame;
using ist::benchmark::mean;
using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

constexpr int kArms = 7, kLinksOfAnArm = 10;
constexpr int kSizes[] = {1, 2, 4, 7};  // arms of a robot
constexpr int kImages = 20, kCycles = 33;

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size()) {
    text.replace(at, what.size(), by);
  }
  return text;
}

// Arms side by side before the table's edge.
std::string urdf_of(const std::vector<int>& arms) {
  const std::string chain = ist::test::long_chain_urdf(kLinksOfAnArm);
  const std::size_t begin = chain.find('\n') + 1, end = chain.rfind("</robot>");
  std::string urdf = "<robot name=\"arms\">\n<link name=\"floor\"/>\n";
  for (const int arm : arms) {
    const std::string name = "\"arm" + std::to_string(arm) + "_";
    const std::string one = chain.substr(begin, end - begin);
    urdf += replaced(replaced(one, "\"link", name + "link"), "\"joint", name + "joint");
    urdf += "<joint name=" + name +
            "base\" type=\"fixed\"><parent link=\"floor\"/><child link=" + name +
            "link0\"/><origin xyz=\"-0.6 " + std::to_string(0.35 * (arm - kArms / 2)) +
            " -0.2\"/></joint>\n";
  }
  return urdf + "</robot>\n";
}

// Joints swing, each in its own time; those of an arm as in every other robot.
std::vector<double> positions(const ist::Kinematics& kinematics, double time) {
  std::vector<double> q;
  for (const auto& joint : kinematics.joints()) {
    int arm = 0, j = 0;
    (void)std::sscanf(joint.name.c_str(), "arm%d_joint%d", &arm, &j);
    q.push_back(0.25 * std::sin(time * (0.5 + 0.1 * (j % 5)) + j + 2 * arm));
  }
  return q;
}

// [us] By cycle, or by image.
struct Times {
  std::vector<double> image, distances, repulsion, frame;
};

// Adds the times of one robot.
void run(const std::vector<int>& arms, const std::string& cache, const Frame& frame, Times* times) {
  const auto description = std::make_shared<const ist::RobotDescription>(
      ist::parse_urdf(urdf_of(arms), ist::GeometrySource::kCollision,
                      [](const std::string&) { return std::string(IST_PROXIMITY_SOURCE_DIR); }));
  ist::RobotModelConfig config;
  config.distance_fields = true;  // as the node has them
  config.cache_directory = cache;
  const auto model = ist::build_robot_model(*description, config);
  const ist::Kinematics kinematics(*description);
  const std::vector<bool> known(model->links.size(), true);
  ist::Ingest ingest(ist::test::whole_cloud(true)), filtering({});
  ist::CloudSnapshot snapshot, filtered;
  ist::ProximityQuery query(model, {});
  const ist::Repulsion repulsion(model);
  std::vector<ist::KeptRepulsion> kept;
  for (std::size_t i = 0; i < model->links.size(); ++i) kept.emplace_back(i);
  std::vector<ist::LinkProximity> results;
  ist::RepulsiveWrench push;
  for (int image = 0; image <= kImages; ++image) {
    const auto poses_at = [&](int cycle) {
      const double time = 1e-3 * (kCycles * image + cycle);
      return ist::link_poses(*model, kinematics, positions(kinematics, time),
                             Eigen::Isometry3d::Identity())
          .X_FL;
    };
    const auto first = poses_at(0);
    ist::RawCloud raw = frame.raw();
    raw.owner = std::shared_ptr<const void>(&frame, [](const void*) {});  // as a message
    ThreadTimer timer;
    filtering.run(raw, frame.X_FS, ist::posed_solids(*model, first, known), 0.0, &filtered);
    double all = timer.lap();
    if (image > 0) times->image.push_back(all);
    // Distances are to all points, so that one arm does not take another's points away.
    ingest.run(raw, frame.X_FS, {}, 0.0, &snapshot);
    for (int cycle = 0; cycle < kCycles; ++cycle) {
      const auto X_FL = poses_at(cycle);
      timer.lap();
      query.run(X_FL, known, {&snapshot}, &results);
      const double distances = timer.lap();
      for (std::size_t i = 0; i < results.size(); ++i) {
        push = kept[i].update(repulsion, X_FL[i], {&snapshot}, results[i], {});
      }
      const double blends = timer.lap();
      all += distances + blends;
      if (image == 0) continue;
      times->distances.push_back(distances);
      times->repulsion.push_back(blends);
    }
    if (image > 0) times->frame.push_back(all);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "Usage: link_growth CACHE_FOLDER [DOCUMENT]\n");
    return 2;
  }
  const Frame frame = ist::benchmark::synthetic_frame(640, 480);
  std::string table =
      "| links | image with self-filter, a link [us] | distances of a cycle, mean / p99, a link "
      "[us] | repulsion of a cycle, mean, a link [us] | image and 33 cycles, mean, a link [us] | / "
      "10 links |\n|---|---|---|---|---|---|\n";
  double smallest = 0.0;
  for (const int size : kSizes) {
    Times times;
    for (int first = 0; first < kArms; ++first) {
      std::vector<int> arms;
      for (int i = 0; i < size; ++i) arms.push_back((first + i) % kArms);
      run(arms, argv[1], frame, &times);
      if (size == kArms) break;  // all others are the same
    }
    const double links = size * kLinksOfAnArm, cost = mean(times.frame) / links;
    if (smallest == 0.0) smallest = cost;
    char row[256];
    std::snprintf(row, sizeof row, "| %.0f | %.1f | %.2f / %.2f | %.2f | %.1f | %.2f |\n", links,
                  mean(times.image) / links, mean(times.distances) / links,
                  quantile(times.distances, 0.99) / links, mean(times.repulsion) / links, cost,
                  cost / smallest);
    table += row;
  }
  std::printf("%s", table.c_str());
  if (argc < 3) return 0;
  return ist::benchmark::write_table(argv[2], "link growth", table) ? 0 : 1;
}
