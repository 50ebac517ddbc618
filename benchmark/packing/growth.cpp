// Growth of time and memory with the triangles of a mesh and the spheres of a packing.

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <utility>

#include "internal/packing/packer.h"
#include "packing/options.h"
#include "support.h"

namespace ist::benchmark {
namespace {

// An upright wavy vase of 2 (n - 1) n triangles.
TriangleMesh vase(int n) {
  TriangleMesh mesh;
  const auto index = [n](int i, int j) { return static_cast<std::uint32_t>(1 + i * n + j % n); };
  mesh.vertices.emplace_back(0.0, 0.0, -0.15);
  for (int i = 0; i < n - 1; ++i) {
    for (int j = 0; j < n; ++j) {
      const double z = 0.3 * (i + 0.5) / (n - 1) - 0.15, angle = 2.0 * M_PI * j / n;
      const double r = (0.06 + 0.01 * std::cos(40.0 * z) + 0.005 * std::cos(5.0 * angle)) *
                       std::sqrt(std::max(0.05, 1.0 - 40.0 * z * z));
      mesh.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
  }
  mesh.vertices.emplace_back(0.0, 0.0, 0.15);
  const auto top = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
  for (int j = 0; j < n; ++j) {
    mesh.triangles.push_back({0, index(0, j + 1), index(0, j)});
    mesh.triangles.push_back({top, index(n - 2, j), index(n - 2, j + 1)});
    for (int i = 0; i + 2 < n; ++i) {
      mesh.triangles.push_back({index(i, j), index(i, j + 1), index(i + 1, j + 1)});
      mesh.triangles.push_back({index(i, j), index(i + 1, j + 1), index(i + 1, j)});
    }
  }
  return mesh;
}

// Memory of this process [MB], from its status.
double memory(const std::string& what) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(what + ":", 0) == 0) return 1e-3 * std::stod(line.substr(what.size() + 1));
  }
  return 0.0;
}

struct Result {
  double seconds = 0.0, gap = 0.0, megabytes = 0.0;
};

Result pack(const TriangleMesh& mesh, int spheres) {
  PackingConfig config;
  config.max_error = 1e-5;  // never reached: the number of spheres decides
  config.max_spheres = spheres;
  const double before = memory("VmRSS");
  ThreadTimer timer;
  const Packing packing = pack_mesh(mesh, config);
  const double us = timer.lap();
  return {1e-6 * us, packing.certificate.max_gap, memory("VmHWM") - before};
}

// Runs in a process of its own, so that the peak of memory is that of this packing alone.
Result pack_alone(const TriangleMesh& mesh, int spheres) {
  int ends[2];
  Result result;
  if (pipe(ends) != 0) return result;
  malloc_trim(0);  // freed memory would be used first and not count
  const pid_t child = fork();
  if (child == 0) {
    result = pack(mesh, spheres);
    const bool written = write(ends[1], &result, sizeof result) == sizeof result;
    _exit(written ? 0 : 1);
  }
  close(ends[1]);
  if (child < 0 || read(ends[0], &result, sizeof result) != sizeof result) result = {};
  close(ends[0]);
  if (child > 0) waitpid(child, nullptr, 0);
  return result;
}

// The table's rows, by the vase's fineness and the number of spheres.
constexpr std::pair<int, int> kCases[] = {{23, 1000}, {71, 1000}, {224, 1000}, {708, 1000},
                                          {71, 50},   {71, 200},  {71, 5000},  {71, 20000}};

std::pair<std::string, std::string> key(const std::pair<int, int>& one) {
  return {std::to_string(2 * (one.first - 1) * one.first), std::to_string(one.second)};
}

}  // namespace

Table growth_table() {
  Table table("growth",
              {"triangles", "spheres", "packing [s]", "certified gap [mm]", "memory, peak [MB]"},
              2);
  for (const auto& one : kCases) table.place({key(one).first, key(one).second});
  return table;
}

bool measure_growth(const Options& options, Table* table) {
  for (const auto& one : kCases) {
    const bool wanted = options.spheres.empty() ||
                        std::count(options.spheres.begin(), options.spheres.end(), one.second) > 0;
    if (!wanted) continue;
    const Result result = pack_alone(vase(one.first), one.second);
    if (!(result.seconds > 0.0)) return false;
    table->add({key(one).first, key(one).second, text("%.2f", result.seconds),
                text("%.2f", 1e3 * result.gap), text("%.1f", result.megabytes)});
  }
  return true;
}

}  // namespace ist::benchmark
