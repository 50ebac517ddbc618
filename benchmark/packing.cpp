// Time to pack the Panda's visual meshes, against a yardstick of the same run: a table of
// doc/benchmark.md. Needs the test data: IST_PROXIMITY_DATA, or ../shared/data.
//
// Usage: packing [DOCUMENT]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <vector>

#ifdef IST_PROXIMITY_EMBREE
#include <embree3/rtcore.h>
#endif

#include "document.h"
#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/mesh_io.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/robot/robot_model.h"
#include "support.h"
#include "support/data_dir.h"
#include "support/temp_dir.h"
#include "support/truth.h"
#include "truth_scenes.h"

namespace ist::benchmark {
namespace {

// Wall time and processor time.
struct Times {
  double wall = 0.0, processor = 0.0;  // [s]
  Times& operator+=(const Times& other) {
    wall += other.wall;
    processor += other.processor;
    return *this;
  }
};

class Stopwatch {
 public:
  Times times() const { return {1e-6 * microseconds_since(start_), processor() - processor_}; }

 private:
  static double processor() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  Clock::time_point start_ = Clock::now();
  double processor_ = processor();
};

#ifdef IST_PROXIMITY_EMBREE
struct Nearest {
  const TriangleMesh* mesh;
  double distance_sq;
};

bool nearer(RTCPointQueryFunctionArguments* arguments) {
  auto* nearest = static_cast<Nearest*>(arguments->userPtr);
  const RTCPointQuery& query = *arguments->query;
  const auto t = arguments->primID;
  const Eigen::Vector3d p(query.x, query.y, query.z);
  const Eigen::Vector3d q = closest_point_on_triangle(
      p, nearest->mesh->corner(t, 0), nearest->mesh->corner(t, 1), nearest->mesh->corner(t, 2));
  const double distance_sq = (p - q).squaredNorm();
  if (distance_sq >= nearest->distance_sq) return false;
  nearest->distance_sq = distance_sq;
  arguments->query->radius = static_cast<float>(std::sqrt(distance_sq));
  return true;
}

// The yardstick: one million closest-point queries of one thread, spread over the meshes.
Times yardstick(const std::vector<TriangleMesh>& links) {
  constexpr int kQueries = 1000000;
  RTCDevice device = rtcNewDevice(nullptr);
  Times times;
  std::mt19937_64 rng(1);
  for (const TriangleMesh& mesh : links) {
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), mesh.vertices.size()));
    auto* corners = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), mesh.triangles.size()));
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& v : mesh.vertices) {
      for (int k = 0; k < 3; ++k) *vertices++ = static_cast<float>(v[k]);
      box.extend(v);
    }
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t v : triangle) *corners++ = v;
    }
    rtcSetGeometryPointQueryFunction(geometry, nearer);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    std::vector<Eigen::Vector3d> points;
    for (std::size_t i = 0; i < kQueries / links.size(); ++i) {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) {
        p[k] = std::uniform_real_distribution<double>(box.min()[k], box.max()[k])(rng);
      }
      points.push_back(p);
    }
    const Stopwatch watch;
    for (const Eigen::Vector3d& p : points) {
      Nearest nearest{&mesh, std::numeric_limits<double>::infinity()};
      RTCPointQuery query{static_cast<float>(p.x()), static_cast<float>(p.y()),
                          static_cast<float>(p.z()), 0.0F, std::numeric_limits<float>::infinity()};
      RTCPointQueryContext context;
      rtcInitPointQueryContext(&context);
      rtcPointQuery(scene, &query, &context, nullptr, &nearest);
    }
    times += watch.times();
    rtcReleaseScene(scene);
  }
  rtcReleaseDevice(device);
  return times;
}
#endif

// The 11 links, of which the fingers share one shape.
RobotDescription panda(const std::vector<TriangleMesh>& links) {
  RobotDescription robot;
  robot.name = "panda";
  for (std::size_t i = 0; i <= links.size(); ++i) {
    LinkDescription link;
    link.name = "link" + std::to_string(i);
    link.geometry = {{links[std::min(i, links.size() - 1)], Eigen::Isometry3d::Identity(), ""}};
    robot.links.push_back(std::move(link));
  }
  return robot;
}

// The Panda's visual meshes; the two fingers are one.
std::vector<TriangleMesh> panda_links(const std::filesystem::path& data) {
  std::vector<TriangleMesh> links;
  const auto folder = data / "robots/franka_description/meshes/visual";
  for (std::size_t i = 0; i + 1 < test::kPandaLinks; ++i) {
    links.push_back(load_mesh((folder / (std::string(test::panda_mesh(i)) + ".dae")).string()));
  }
  return links;
}

int run(const std::string& document) {
  const std::vector<TriangleMesh> links = panda_links(data_or_exit());
  const RobotDescription robot = panda(links);
  std::string table =
      "| max_error [mm] | spheres | packing [s] | processor time [s] | in yardsticks | processor "
      "time per core, in yardsticks | from the cache [s] | yardstick [s] |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const double max_error : {0.005, 0.002}) {
    Times unit;
#ifdef IST_PROXIMITY_EMBREE
    unit = yardstick(links);
#endif
    const test::TempDir folder;
    RobotModelConfig config;
    config.packing.max_error = max_error;
    config.cache_directory = folder.path().string();
    const Stopwatch watch;
    const auto model = build_robot_model(robot, config);
    const Times packing = watch.times();
    double cached = std::numeric_limits<double>::infinity();
    for (int round = 0; round < 5; ++round) {
      const Stopwatch reading;
      build_robot_model(robot, config);
      cached = std::min(cached, reading.times().wall);
    }
    std::size_t spheres = 0;
    for (const LinkModel& link : model->links) spheres += link.packing.spheres.size();
    const double cores = std::min<double>(std::max(1U, std::thread::hardware_concurrency()),
                                          static_cast<double>(robot.links.size()));
    const auto in_yardsticks = [](double time, double yardstick) {
      return yardstick > 0.0 ? time / yardstick : 0.0;
    };
    char row[200];
    std::snprintf(row, sizeof row, "| %g | %zu | %.2f | %.2f | %.2f | %.2f | %.3f | %.2f |\n",
                  1e3 * max_error, spheres, packing.wall, packing.processor,
                  in_yardsticks(packing.wall, unit.wall),
                  in_yardsticks(packing.processor / cores, unit.processor), cached, unit.wall);
    std::printf("%s", row);
    table += row;
  }
  return document.empty() || write_table(document, "time", table) ? 0 : 1;
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) { return ist::benchmark::run(argc > 1 ? argv[1] : ""); }
