// Packings of the Franka Panda's visual meshes as Markdown tables: time against a yardstick, gaps by
// number of balls in the three orders, how far the certificate is from the truth, growth.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Usage: packing [TABLE ...], of
// time, gaps, certificate, growth; all by default.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>
#include <thread>
#include <vector>

#ifdef IST_PROXIMITY_EMBREE
#include <embree3/rtcore.h>
#endif

#include "support.h"
#include "ist_proximity/geometry/mesh_io.h"
#include "ist_proximity/geometry/tessellation.h"
#include "ist_proximity/packing/packer.h"
#include "ist_proximity/packing/packing_report.h"
#include "packing/ball_search.h"
#include "support/data_dir.h"
#include "support/temp_dir.h"
#include "support/truth.h"

namespace {

using ist::benchmark::Clock;
using Rng = std::mt19937_64;

double seconds_since(Clock::time_point start) {
  return 1e-6 * ist::benchmark::microseconds_since(start);
}

constexpr std::size_t kMeshes = 10;  // the two fingers are one mesh

std::vector<ist::TriangleMesh> panda_meshes(const std::filesystem::path& data) {
  std::vector<ist::TriangleMesh> meshes;
  for (std::size_t i = 0; i < kMeshes; ++i) {
    meshes.push_back(ist::load_mesh((data / "robots/franka_description/meshes/visual" /
                                     (std::string(ist::test::panda_mesh(i)) + ".dae"))
                                        .string()));
  }
  return meshes;
}

double uniform(Rng* rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*rng);
}

// Evenly over the mesh's box, widened by a margin.
Eigen::Vector3d point_about(const Eigen::AlignedBox3d& box, double margin, Rng* rng) {
  Eigen::Vector3d p;
  for (int k = 0; k < 3; ++k) p[k] = uniform(rng, box.min()[k] - margin, box.max()[k] + margin);
  return p;
}

#ifdef IST_PROXIMITY_EMBREE
struct Nearest {
  const ist::TriangleMesh* mesh;
  double distance_sq;
};

bool nearer(RTCPointQueryFunctionArguments* arguments) {
  auto* nearest = static_cast<Nearest*>(arguments->userPtr);
  const RTCPointQuery& query = *arguments->query;
  const auto t = arguments->primID;
  const Eigen::Vector3d p(query.x, query.y, query.z);
  const Eigen::Vector3d q = ist::closest_point_on_triangle(
      p, nearest->mesh->corner(t, 0), nearest->mesh->corner(t, 1), nearest->mesh->corner(t, 2));
  const double distance_sq = (p - q).squaredNorm();
  if (distance_sq >= nearest->distance_sq) return false;
  nearest->distance_sq = distance_sq;
  arguments->query->radius = static_cast<float>(std::sqrt(distance_sq));
  return true;
}

// [s] of one million closest-point queries of one thread, spread over the meshes.
double yardstick(const std::vector<ist::TriangleMesh>& meshes) {
  constexpr int kQueries = 1000000;
  RTCDevice device = rtcNewDevice(nullptr);
  double seconds = 0.0;
  Rng rng(1);
  for (const ist::TriangleMesh& mesh : meshes) {
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
    for (std::size_t i = 0; i < kQueries / meshes.size(); ++i) {
      points.push_back(point_about(box, 0.0, &rng));
    }
    const auto start = Clock::now();
    for (const Eigen::Vector3d& p : points) {
      Nearest nearest{&mesh, std::numeric_limits<double>::infinity()};
      RTCPointQuery query{static_cast<float>(p.x()), static_cast<float>(p.y()),
                          static_cast<float>(p.z()), 0.0F, std::numeric_limits<float>::infinity()};
      RTCPointQueryContext context;
      rtcInitPointQueryContext(&context);
      rtcPointQuery(scene, &query, &context, nullptr, &nearest);
    }
    seconds += seconds_since(start);
    rtcReleaseScene(scene);
  }
  rtcReleaseDevice(device);
  return seconds;
}
#endif

void print_time(const std::vector<ist::TriangleMesh>& meshes) {
  ist::RobotDescription robot;
  robot.name = "panda";
  for (std::size_t i = 0; i < ist::test::kPandaLinks; ++i) {
    ist::LinkDescription link;
    link.name = "link" + std::to_string(i);
    link.geometry = {{meshes[std::min(i, kMeshes - 1)], Eigen::Isometry3d::Identity(), ""}};
    robot.links.push_back(std::move(link));
  }
  double unit = 0.0;
#ifdef IST_PROXIMITY_EMBREE
  unit = yardstick(meshes);
  std::printf("Yardstick: %.2f s. ", unit);
#else
  std::printf("Yardstick: not measured, Embree is not there. ");
#endif
  std::printf("%u threads.\n\n| max_error [mm] | balls | packing [s] | in yardsticks | from the "
              "cache [s] | share |\n|---|---|---|---|---|---|\n",
              std::thread::hardware_concurrency());
  for (const double max_error : {0.005, 0.002}) {
    const ist::test::TempDir folder;
    ist::RobotModelConfig config;
    config.packing.max_error = max_error;
    config.cache_directory = folder.path().string();
    double seconds[2];
    std::size_t balls = 0;
    for (double& time : seconds) {
      const auto start = Clock::now();
      const auto model = ist::build_robot_model(robot, config);
      time = seconds_since(start);
      balls = 0;
      for (const ist::LinkModel& link : model->links) balls += link.packing.balls.size();
    }
    char multiple[32] = "not measured";
    if (unit > 0.0) std::snprintf(multiple, sizeof multiple, "%.2f", seconds[0] / unit);
    std::printf("| %g | %zu | %.2f | %s | %.3f | 1/%.0f |\n", 1e3 * max_error, balls, seconds[0],
                multiple, seconds[1], seconds[0] / seconds[1]);
  }
}

ist::PackingConfig by_count(int count, ist::PackingOrder order) {
  ist::PackingConfig config;
  config.max_error = 1e-5;  // never reached: the number of balls decides
  config.max_spheres = count;
  config.order = order;
  return config;
}

void print_gaps(const std::vector<ist::TriangleMesh>& meshes) {
  std::printf("\n| link | balls | medial: gap max / mean [mm] | disjoint | filled [%%] | volume | "
              "filled [%%] |\n|---|---|---|---|---|---|---|\n");
  for (const int count : {200, 1000, 5000, 20000}) {
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      const ist::Solid solid({{meshes[i], Eigen::Isometry3d::Identity(), ""}});
      std::printf("| %s | %d |", ist::test::panda_mesh(i), count);
      for (const auto order : {ist::PackingOrder::kMedial, ist::PackingOrder::kDisjoint,
                               ist::PackingOrder::kVolume}) {
        const ist::Packing packing = ist::pack_mesh(meshes[i], by_count(count, order));
        std::printf(" %.2f / %.2f |", 1e3 * packing.certificate.max_gap,
                    1e3 * packing.certificate.mean_gap);
        if (order == ist::PackingOrder::kMedial) continue;
        const ist::PackingReport report = ist::measure_packing(solid, packing.balls);
        std::printf(" %.1f |", 100.0 * report.filled_volume / report.solid_volume);
      }
      std::printf("\n");
    }
  }
}

// [m] largest distance of a million points of the surface to the inner balls.
double sampled_gap(const ist::TriangleMesh& mesh, const ist::BallSearch& balls, Rng* rng) {
  std::vector<double> areas;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    areas.push_back((mesh.corner(t, 1) - mesh.corner(t, 0))
                        .cross(mesh.corner(t, 2) - mesh.corner(t, 0))
                        .norm());
  }
  std::discrete_distribution<std::size_t> by_area(areas.begin(), areas.end());
  double largest = 0.0;
  for (int i = 0; i < 1000000; ++i) {
    const std::size_t t = by_area(*rng);
    double u = uniform(rng, 0.0, 1.0), v = uniform(rng, 0.0, 1.0);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const Eigen::Vector3d p = mesh.corner(t, 0) + u * (mesh.corner(t, 1) - mesh.corner(t, 0)) +
                              v * (mesh.corner(t, 2) - mesh.corner(t, 0));
    largest = std::max(largest, balls.best(&p, 1, 0).cost);
  }
  return largest;
}

void print_certificate(const std::vector<ist::TriangleMesh>& meshes) {
  constexpr int kPoints = 1000000;
  std::printf("\n| link | certified gap [mm] | sampled gap [mm] | above it [%%] | points outside | "
              "d_IST < d_mesh | by at most [mm] | d_IST > d_mesh + gap |\n"
              "|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    Rng rng(i);
    const ist::Packing packing = ist::pack_mesh(meshes[i], {});
    ist::BallSearch balls;
    for (const ist::Ball& ball : packing.balls) balls.add(ball.center, ball.radius);
    const double gap = packing.certificate.max_gap, sampled = sampled_gap(meshes[i], balls, &rng);
    const ist::TriangleBvh bvh(meshes[i]);
    int outside = 0, below = 0, above = 0;
    double deepest = 0.0;
    while (outside < kPoints) {
      const Eigen::Vector3d p = point_about(bvh.bounds(), 0.05, &rng);
      if (bvh.is_inside(p)) continue;
      ++outside;
      const double d_mesh = std::sqrt(bvh.closest(p).distance_sq);
      const double d_ist = balls.best(&p, 1, 0).cost;
      below += d_ist < d_mesh - 1e-12 ? 1 : 0;
      above += d_ist > d_mesh + gap ? 1 : 0;
      deepest = std::max(deepest, d_mesh - d_ist);
    }
    std::printf("| %s | %.3f | %.3f | %.0f | %d | %d | %.3f | %d |\n", ist::test::panda_mesh(i),
                1e3 * gap, 1e3 * sampled, 100.0 * (gap / sampled - 1.0), outside, below,
                1e3 * deepest, above);
  }
}

// An upright wavy vase of 2 (n - 1) n triangles.
ist::TriangleMesh vase(int n) {
  ist::TriangleMesh mesh;
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

// [MB] in use now.
double resident() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%*s %ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<double>(pages) * 4096e-6;
}

void print_growth() {
  std::printf("\n| triangles | balls | packing [s] | certified gap [mm] | memory [MB] |\n"
              "|---|---|---|---|---|\n");
  const auto row = [](int n, int count) {
    const ist::TriangleMesh mesh = vase(n);
    const double before = resident();
    double most = before;
    const auto start = Clock::now();
    const ist::Packing packing =
        ist::pack_mesh(mesh, by_count(count, ist::PackingOrder::kMedial), [&most](double) {
          most = std::max(most, resident());
          return true;
        });
    std::printf("| %zu | %d | %.2f | %.2f | %.0f |\n", mesh.triangles.size(), count,
                seconds_since(start), 1e3 * packing.certificate.max_gap, most - before);
  };
  for (const int n : {23, 71, 224, 708}) row(n, 1000);
  for (const int count : {50, 200, 5000, 20000}) row(71, count);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // rows as they come
  const auto wanted = [&](const char* table) {
    if (argc == 1) return true;
    return std::any_of(argv + 1, argv + argc,
                       [table](const char* name) { return std::strcmp(name, table) == 0; });
  };
  const auto data = ist::test::data_dir();
  if (!data) {
    std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
    return 1;
  }
  const std::vector<ist::TriangleMesh> meshes = panda_meshes(*data);
  if (wanted("time")) print_time(meshes);
  if (wanted("certificate")) print_certificate(meshes);
  if (wanted("growth")) print_growth();
  if (wanted("gaps")) print_gaps(meshes);
  return 0;
}
