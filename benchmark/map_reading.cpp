// Reading of OctoMap trees: ours against liboctomap's, in time and memory, and on data that is cut
// off.
//
// Usage: map_reading [points] [cuts]

#include <octomap/octomap.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "support.h"

namespace {

constexpr double kResolution = 0.02;  // [m]
constexpr int kRepetitions = 7;

/// Walls and clutter of a room, seen as points, with the free space before them.
octomap::OcTree make_tree(int points) {
  octomap::OcTree tree(kResolution);
  std::mt19937_64 rng(1);
  std::uniform_real_distribution<float> place(-3.0F, 3.0F);
  for (int i = 0; i < points; ++i) {
    std::array<float, 3> p = {place(rng), place(rng), place(rng)};
    p[static_cast<std::size_t>(i) % 3] = i % 2 == 0 ? -3.0F : 0.3F * p[1];
    tree.updateNode(octomap::point3d(p[0], p[1], p[2]), true, true);
    tree.updateNode(octomap::point3d(0.5F * p[0], 0.5F * p[1], 0.5F * p[2]), false, true);
  }
  tree.updateInnerOccupancy();
  tree.prune();
  return tree;
}

std::size_t occupied_of(const octomap::OcTree& tree) {
  std::size_t occupied = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    occupied += tree.isNodeOccupied(*leaf) ? 1 : 0;
  }
  return occupied;
}

ist::OctreeData data_of(const std::string& bytes) {
  ist::OctreeData data;
  data.id = "OcTree";
  data.is_binary = true;
  data.resolution = kResolution;
  data.data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  data.size = bytes.size();
  return data;
}

/// The boxes of the occupied leaves, as an index of obstacles needs them.
std::vector<Eigen::AlignedBox3d> boxes_by_liboctomap(const std::string& bytes,
                                                     std::size_t* tree_bytes) {
  octomap::OcTree tree(kResolution);
  std::istringstream in(bytes);
  tree.readBinaryData(in);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    const Eigen::Vector3d center(leaf.getX(), leaf.getY(), leaf.getZ());
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * leaf.getSize());
    boxes.emplace_back(center - half, center + half);
  }
  *tree_bytes = tree.memoryUsage();
  return boxes;
}

enum class Outcome { kRefused, kOtherMap, kCrash };

/// What liboctomap does with bytes, in a process of its own with a limit on time and memory.
Outcome outcome_of_liboctomap(const std::string& bytes, std::size_t occupied) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit memory = {std::size_t{1} << 31U, std::size_t{1} << 31U};
    setrlimit(RLIMIT_AS, &memory);
    const rlimit none = {0, 0};
    setrlimit(RLIMIT_CORE, &none);
    alarm(10);
    octomap::OcTree tree(kResolution);
    std::istringstream in(bytes);
    const bool is_read = static_cast<bool>(tree.readBinaryData(in));
    _exit(!is_read || occupied_of(tree) == occupied ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status)) return Outcome::kCrash;
  return WEXITSTATUS(status) == 0 ? Outcome::kOtherMap : Outcome::kRefused;
}

}  // namespace

int main(int argc, char** argv) {
  const int points = argc > 1 ? std::atoi(argv[1]) : 1000000;
  const int cuts = argc > 2 ? std::atoi(argv[2]) : 50;
  std::string bytes;
  std::size_t occupied = 0;
  {
    const octomap::OcTree tree = make_tree(points);
    std::ostringstream out;
    tree.writeBinaryData(out);
    bytes = out.str();
    occupied = occupied_of(tree);
  }
  std::vector<double> ours_us, theirs_us;
  ist::Octree octree;
  std::size_t tree_bytes = 0, boxes = 0;
  ist::benchmark::ThreadTimer timer;
  for (int i = 0; i < kRepetitions; ++i) {
    timer.lap();
    const std::string fault = ist::read_octree(data_of(bytes), &octree);
    ours_us.push_back(timer.lap());
    boxes = boxes_by_liboctomap(bytes, &tree_bytes).size();
    theirs_us.push_back(timer.lap());
    if (!fault.empty() || octree.occupied.size() != occupied || boxes != occupied) {
      std::fprintf(stderr, "the readers differ: %s\n", fault.c_str());
      return 1;
    }
  }
  const double ours = ist::benchmark::quantile(ours_us, 0.5);
  const double theirs = ist::benchmark::quantile(theirs_us, 0.5);
  const double box_bytes = static_cast<double>(occupied * sizeof(Eigen::AlignedBox3d));

  const std::string cut_name = "cut off", noise_name = "random bytes";
  std::mt19937_64 rng(2);
  std::printf("%zu occupied leaves, %.1f MB of data, to a list of boxes of %.1f MB\n\n", occupied,
              1e-6 * static_cast<double>(bytes.size()), 1e-6 * box_bytes);
  std::printf("| reader | time | memory beside the boxes |\n|---|---:|---:|\n");
  std::printf("| ours | %.1f ms | 0 MB |\n", 1e-3 * ours);
  std::printf("| liboctomap | %.1f ms | %.1f MB |\n\n", 1e-3 * theirs,
              1e-6 * static_cast<double>(tree_bytes));
  std::printf(
      "| data | refused by ours | by liboctomap | taken by it for another map | crash or more than "
      "10 s |\n|---|---:|---:|---:|---:|\n");
  for (const std::string& name : {cut_name, noise_name}) {
    std::array<int, 3> outcomes = {};
    int refused_by_us = 0;
    for (int i = 1; i <= cuts; ++i) {
      std::string damaged = bytes.substr(
          0, bytes.size() * static_cast<std::size_t>(i) / static_cast<std::size_t>(cuts + 1));
      if (name == noise_name) {
        for (char& byte : damaged) byte = static_cast<char>(rng());
      }
      ++outcomes[static_cast<std::size_t>(outcome_of_liboctomap(damaged, occupied))];
      refused_by_us += ist::read_octree(data_of(damaged), &octree).empty() ? 0 : 1;
    }
    std::printf("| %s | %d of %d | %d | %d | %d |\n", name.c_str(), refused_by_us, cuts,
                outcomes[0], outcomes[1], outcomes[2]);
  }
}
