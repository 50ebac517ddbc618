// Lower bounds against true surfaces, with the extent of points and without, as Markdown tables.
//
// Simulated: spheres, boxes and a table seen by a depth camera with the published noise of a
// Kinect. Real: Kinect frames of tables, against planes fitted to them; from IST_PROXIMITY_DATA, or
// ../shared/data.
// Usage: extent [--update-doc doc/accuracy.md] [more organized 640 x 480 .pcd files ...]

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "support/pcd.h"
#include "support/scene.h"

namespace {

using ist::ExtentConfig;
using ist::test::Rng;
using ist::test::uniform;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxRange = 3.0;     // [m]
constexpr double kTolerance = 0.001;  // [m]
const std::vector<double> kLinkRadii = {0.01, 0.03, 0.1};

// The answers of one configuration.
struct Tally {
  std::vector<double> gap;    // [m] true distance - lower bound, negative: the bound failed
  std::vector<double> width;  // [m] distance - lower_bound
  std::vector<double> query_us;
};

// Links that are spheres: their distance to a shape is exact.
class SphereLinks {
 public:
  SphereLinks() {
    std::vector<ist::Shape> shapes;
    for (const double radius : kLinkRadii) shapes.emplace_back(ist::Sphere{radius});
    ist::QueryConfig config;
    config.tolerance = kTolerance;
    query_ = std::make_unique<ist::ProximityQuery>(ist::test::make_model(shapes, 0.001), config);
  }

  // @param center    [m] of a sphere, in the cloud's frame
  // @param distance  [m] of its centre from the true surface
  void measure(std::size_t link, const Eigen::Vector3d& center, double distance,
               const ist::CloudSnapshot& cloud, Tally* tally) {
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = center;
    ist::LinkProximity answer;
    ist::benchmark::ThreadTimer timer;
    query_->run_link(link, X_FL, {&cloud}, &answer);
    const double us = timer.lap();
    if (answer.state < ist::LinkState::kNear) return;
    tally->query_us.push_back(us);
    tally->gap.push_back(distance - kLinkRadii[link] - answer.lower_bound);
    tally->width.push_back(answer.distance - answer.lower_bound);
  }

 private:
  std::unique_ptr<ist::ProximityQuery> query_;
};

std::string percent(double share) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.2f %%", 100.0 * share);
  return text.data();
}

// The share of a normal distribution within k standard deviations.
double stated_share(double k) { return std::erf(k / std::sqrt(2.0)); }

std::string row(const std::string& scene, const std::string& points, double k, const Tally& tally) {
  const auto held =
      std::count_if(tally.gap.begin(), tally.gap.end(), [](double gap) { return gap >= 0.0; });
  const auto cases = static_cast<double>(tally.gap.size());
  const double above = std::max(0.0, -ist::benchmark::quantile(tally.gap, 0.0));
  std::array<char, 160> text;
  std::snprintf(text.data(), text.size(), " | %zu | %s | %s | %.1f mm | %.1f mm |\n",
                tally.gap.size(), percent(static_cast<double>(held) / cases).c_str(),
                k > 0.0 ? percent(stated_share(k)).c_str() : "-", 1e3 * above,
                1e3 * ist::benchmark::mean(tally.width));
  return "| " + scene + " | " + points + text.data();
}

const char* const kHeader =
    "| scene | points are | cases | `lower_bound` holds | at least | worst | interval, mean |\n"
    "| --- | --- | --- | --- | --- | --- | --- |\n";

// ---------------------------------------------------------------- simulated

// A table with things on it, in the camera's frame (z forward).
struct Scene {
  struct Ball {
    Eigen::Vector3d center;
    double radius;
  };
  Eigen::Vector3d table_normal;  // towards the camera
  double table_offset;           // normal . p = offset on the table
  std::vector<Ball> balls;

  // [m] Signed distance of the nearest surface; positive outside.
  double distance(const Eigen::Vector3d& p, Eigen::Vector3d* nearest) const {
    double least = table_normal.dot(p) - table_offset;
    *nearest = p - least * table_normal;
    for (const Ball& ball : balls) {
      const double d = (p - ball.center).norm() - ball.radius;
      if (d >= least) continue;
      least = d;
      *nearest = p - d * (p - ball.center).normalized();
    }
    return least;
  }

  // [m] Along a ray of unit length from the camera; inf: nothing is hit.
  double range(const Eigen::Vector3d& ray) const {
    double least = kInfinity;
    const double along = table_normal.dot(ray);
    if (along < 0.0) least = table_offset / along;
    for (const Ball& ball : balls) {
      const double b = ray.dot(ball.center);
      const double root = b * b - ball.center.squaredNorm() + ball.radius * ball.radius;
      if (root >= 0.0 && b > std::sqrt(root)) least = std::min(least, b - std::sqrt(root));
    }
    return least;
  }
};

Scene random_scene(Rng* rng) {
  Scene scene;
  const double tilt = uniform(rng, 0.3, 1.0);  // between the table's normal and the view
  scene.table_normal = Eigen::Vector3d(0.0, -std::sin(tilt), -std::cos(tilt));
  scene.table_offset = -uniform(rng, 0.7, 1.8) * std::cos(tilt);
  for (int i = 0; i < 4; ++i) {
    const double z = uniform(rng, 0.7, 1.6);
    scene.balls.push_back({{uniform(rng, -0.3, 0.3) * z, uniform(rng, -0.25, 0.25) * z, z},
                           uniform(rng, 0.02, 0.12)});
  }
  return scene;
}

struct Camera {
  std::size_t width, height;
  double focal_length;  // [pixels]
  Eigen::Vector3d ray(std::size_t u, std::size_t v) const {
    const auto x = static_cast<double>(u) - 0.5 * static_cast<double>(width - 1);
    const auto y = static_cast<double>(v) - 0.5 * static_cast<double>(height - 1);
    return Eigen::Vector3d(x / focal_length, y / focal_length, 1.0).normalized();
  }
  bool sees(const Eigen::Vector3d& p) const {
    return p.z() > 0.1 &&
           std::abs(p.x() / p.z()) * focal_length < 0.49 * static_cast<double>(width) &&
           std::abs(p.y() / p.z()) * focal_length < 0.49 * static_cast<double>(height);
  }
};

// What is wrong with what the camera says.
struct Errors {
  double a = 0.0, b = 0.0;          // noise, as ExtentConfig has it
  double offset = 0.0, turn = 0.0;  // [m], [rad]: largest calibration errors
};

std::vector<Eigen::Vector3d> image(const Scene& scene, const Camera& camera, const Errors& errors,
                                   Rng* rng) {
  std::normal_distribution<double> normal;
  Eigen::Isometry3d wrong = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d axis = ist::test::random_vector(rng, 1.0).normalized();
  wrong.linear() =
      Eigen::AngleAxisd(uniform(rng, -errors.turn, errors.turn), axis).toRotationMatrix();
  wrong.translation() =
      uniform(rng, 0.0, errors.offset) * ist::test::random_vector(rng, 1.0).normalized();
  std::vector<Eigen::Vector3d> points;
  points.reserve(camera.width * camera.height);
  for (std::size_t v = 0; v < camera.height; ++v) {
    for (std::size_t u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.ray(u, v);
      const double range = scene.range(ray);
      const double sigma = errors.a + errors.b * range * range;
      const double read = range < kMaxRange ? range + sigma * normal(*rng)
                                            : std::numeric_limits<double>::quiet_NaN();
      points.emplace_back(wrong * (read * ray));
    }
  }
  return points;
}

template <class Point>
ist::RawCloud raw_image(const std::vector<Point>& points, std::size_t width) {
  using Scalar = typename Point::Scalar;
  ist::RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(points.data());
  raw.width = width;
  raw.height = points.size() / width;
  raw.point_step = sizeof(Point);
  raw.row_step = width * sizeof(Point);
  raw.y = sizeof(Scalar);
  raw.z = 2 * sizeof(Scalar);
  raw.is_double = sizeof(Scalar) == 8;
  return raw;
}

template <class Point>
ist::CloudSnapshot ingest(const std::vector<Point>& points, std::size_t width,
                          const ExtentConfig& extent) {
  ist::IngestConfig config;
  config.max_range = kMaxRange;
  config.self_filter = false;
  config.extent = extent;
  ist::CloudSnapshot snapshot;
  ist::Ingest(config).run(raw_image(points, width), Eigen::Isometry3d::Identity(), {}, 0.0,
                          &snapshot);
  return snapshot;
}

ExtentConfig kinect(double k, bool footprint) {
  const ist::SensorModel& model = *ist::find_sensor_model("kinect_v1");
  ExtentConfig config;
  config.noise_constant = model.noise_constant;
  config.noise_quadratic = model.noise_quadratic;
  config.sigmas = k;
  if (!footprint) return config;
  config.footprint = ExtentConfig::Footprint::kCamera;
  config.field_of_view = model.field_of_view;
  return config;
}

// Places whose nearest true surface the camera sees.
struct Place {
  Eigen::Vector3d center;
  double distance;
  std::size_t link;
};

std::vector<Place> random_places(const Scene& scene, const Camera& camera, int count, Rng* rng) {
  std::vector<Place> places;
  for (int i = 0; i < 100 * count && static_cast<int>(places.size()) < count; ++i) {
    const double z = uniform(rng, 0.5, 1.8);
    Place place{{uniform(rng, -0.4, 0.4) * z, uniform(rng, -0.3, 0.3) * z, z}, 0.0, 0};
    place.link = static_cast<std::size_t>(uniform(rng, 0, 2.999));
    Eigen::Vector3d nearest;
    place.distance = scene.distance(place.center, &nearest);
    const double gap = place.distance - kLinkRadii[place.link];
    if (gap < 0.005 || gap > 0.3 || !camera.sees(nearest)) continue;
    if (scene.range(nearest.normalized()) < nearest.norm() - 1e-9) continue;  // hidden
    places.push_back(place);
  }
  return places;
}

struct SimulatedCase {
  std::string name;
  Camera camera;
  Errors errors;
  double calibration, calibration_angle;
};

void simulate(const SimulatedCase& simulated, std::string* table) {
  const std::vector<double> ks = {0.0, 3.0};
  std::vector<Tally> tallies(ks.size());
  SphereLinks links;
  Rng rng(19);
  for (int i = 0; i < 40; ++i) {
    const Scene scene = random_scene(&rng);
    const std::vector<Eigen::Vector3d> points =
        image(scene, simulated.camera, simulated.errors, &rng);
    const std::vector<Place> places = random_places(scene, simulated.camera, 100, &rng);
    for (std::size_t k = 0; k < ks.size(); ++k) {
      ExtentConfig extent = kinect(ks[k], true);
      extent.calibration = simulated.calibration;
      extent.calibration_angle = simulated.calibration_angle;
      if (ks[k] == 0.0) extent = ExtentConfig();
      const ist::CloudSnapshot cloud = ingest(points, simulated.camera.width, extent);
      for (const Place& place : places) {
        links.measure(place.link, place.center, place.distance, cloud, &tallies[k]);
      }
    }
  }
  for (std::size_t k = 0; k < ks.size(); ++k) {
    std::array<char, 32> points;
    std::snprintf(points.data(), points.size(), "k = %.0f", ks[k]);
    *table += row(simulated.name, ks[k] == 0.0 ? "points" : points.data(), ks[k], tallies[k]);
    std::printf("%s, k = %.0f: query p50 / p99 %.1f / %.1f us\n", simulated.name.c_str(), ks[k],
                ist::benchmark::quantile(tallies[k].query_us, 0.5),
                ist::benchmark::quantile(tallies[k].query_us, 0.99));
  }
}

// ---------------------------------------------------------------- real

struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // towards the camera
  double offset = 0.0;
  double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

Plane fit(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  Plane plane;
  plane.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  if (plane.normal.dot(mean) > 0.0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(mean);
  return plane;
}

std::vector<Eigen::Vector3d> near_plane(const std::vector<Eigen::Vector3d>& points,
                                        const Plane& plane, double within) {
  std::vector<Eigen::Vector3d> near;
  for (const Eigen::Vector3d& p : points) {
    if (std::abs(plane.height(p)) < within) near.push_back(p);
  }
  return near;
}

// The plane with the most points within 1 cm, then a least squares fit of those within 2 cm.
Plane find_table(const std::vector<Eigen::Vector3d>& points, Rng* rng) {
  std::uniform_int_distribution<std::size_t> any(0, points.size() - 1);
  Plane best;
  std::size_t most = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d a = points[any(*rng)], b = points[any(*rng)], c = points[any(*rng)];
    Plane plane;
    plane.normal = (b - a).cross(c - a).normalized();
    plane.offset = plane.normal.dot(a);
    std::size_t count = 0;
    for (std::size_t k = 0; k < points.size(); k += 37) {
      count += std::abs(plane.height(points[k])) < 0.01 ? 1 : 0;
    }
    if (count <= most) continue;
    most = count;
    best = plane;
  }
  for (int i = 0; i < 3; ++i) best = fit(near_plane(points, best, 0.02));
  return best;
}

// Places above the table, with nothing but the table near their foot.
std::vector<Place> places_above(const std::vector<Eigen::Vector3d>& points, const Plane& table,
                                int count, Rng* rng) {
  const std::vector<Eigen::Vector3d> on_table = near_plane(points, table, 0.02);
  std::uniform_int_distribution<std::size_t> any(0, on_table.size() - 1);
  std::vector<Place> places;
  for (int i = 0; i < 100 * count && static_cast<int>(places.size()) < count; ++i) {
    const Eigen::Vector3d seen = on_table[any(*rng)];
    const Eigen::Vector3d foot = seen - table.height(seen) * table.normal;
    Place place;
    place.link = static_cast<std::size_t>(uniform(rng, 0, 2.999));
    place.distance = kLinkRadii[place.link] + uniform(rng, 0.005, 0.15);
    place.center = foot + place.distance * table.normal;
    // No other thing is as near, nor in the shape of a lower ground beside the table.
    int beside = 0;
    bool is_free = true;
    for (const Eigen::Vector3d& p : points) {
      const double from_foot_sq = (p - foot).squaredNorm();
      beside += from_foot_sq < 0.03 * 0.03 ? 1 : 0;
      const bool near = (p - place.center).norm() < place.distance + 0.02;
      is_free = is_free && !(near && std::abs(table.height(p)) > 0.02);
    }
    if (is_free && beside > 50) places.push_back(place);
  }
  return places;
}

void measure_frame(const std::vector<Eigen::Vector3f>& frame, Tally* residuals,
                   std::vector<Tally>* tallies, const std::vector<double>& ks) {
  Rng rng(7);
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3f& p : frame) {
    if (p.allFinite() && p.norm() < 1.8F) points.emplace_back(p.cast<double>());
  }
  if (points.size() < 20000) return;
  const Plane table = find_table(points, &rng);
  const ist::SensorModel& model = *ist::find_sensor_model("kinect_v1");
  for (const Eigen::Vector3d& p : near_plane(points, table, 0.02)) {
    // The error along the ray, in standard deviations.
    const double along = std::abs(table.normal.dot(p.normalized()));
    const double sigma = model.noise_constant + model.noise_quadratic * p.squaredNorm();
    residuals->gap.push_back(std::abs(table.height(p)) / along / sigma);
  }
  const std::vector<Place> places = places_above(points, table, 150, &rng);
  SphereLinks links;
  for (std::size_t k = 0; k < ks.size(); ++k) {
    const ist::CloudSnapshot cloud =
        ingest(frame, 640, ks[k] == 0.0 ? ExtentConfig() : kinect(ks[k], true));
    for (const Place& place : places) {
      links.measure(place.link, place.center, place.distance, cloud, &(*tallies)[k]);
    }
  }
}

std::string measure_real(const std::vector<std::string>& files, std::string* table) {
  const std::vector<double> ks = {0.0, 3.0};
  std::vector<Tally> tallies(ks.size());
  Tally residuals;
  for (const std::string& file : files) {
    measure_frame(ist::test::read_pcd(file), &residuals, &tallies, ks);
  }
  if (residuals.gap.empty()) return "";
  for (std::size_t k = 0; k < ks.size(); ++k) {
    std::array<char, 32> points;
    std::snprintf(points.data(), points.size(), "k = %.0f", ks[k]);
    *table +=
        row("real Kinect, tables", ks[k] == 0.0 ? "points" : points.data(), ks[k], tallies[k]);
  }
  const auto within = [&](double k) {
    const auto count = std::count_if(residuals.gap.begin(), residuals.gap.end(),
                                     [k](double error) { return error <= k; });
    return percent(static_cast<double>(count) / static_cast<double>(residuals.gap.size()));
  };
  std::array<char, 256> text;
  std::snprintf(text.data(), text.size(),
                "Of %zu points of the real tables, %s, %s and %s are within 1, 2 and 3 standard "
                "deviations of the plane.\n",
                residuals.gap.size(), within(1.0).c_str(), within(2.0).c_str(),
                within(3.0).c_str());
  return text.data();
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  ist::benchmark::Arguments arguments(argc, argv);
  const std::string document = arguments.text("update-doc");
  std::vector<std::string> files = arguments.rest();
  for (const char* name : {"mosd0.pcd", "mosd10.pcd", "mosd40.pcd"}) {
    files.push_back((data / "clouds" / name).string());
  }
  const ist::SensorModel& model = *ist::find_sensor_model("kinect_v1");
  const Errors noise{model.noise_constant, model.noise_quadratic, 0.0, 0.0};
  Errors calibration = noise;
  calibration.offset = 0.005;
  calibration.turn = 0.005;
  const double half = std::tan(0.5 * model.field_of_view);
  const Camera fine{320, 240, 319.0 / (2.0 * half)}, coarse{80, 60, 79.0 / (2.0 * half)};
  std::string table = kHeader;
  simulate({"320 x 240, noise", fine, noise, 0.0, 0.0}, &table);
  simulate({"80 x 60, no noise", coarse, {}, 0.0, 0.0}, &table);
  simulate({"80 x 60, noise", coarse, noise, 0.0, 0.0}, &table);
  simulate({"320 x 240, noise, calibration", fine, calibration, 0.005, 0.005}, &table);
  const std::string points = measure_real(files, &table);
  std::printf("%s\n%s", table.c_str(), points.c_str());
  if (document.empty()) return 0;
  return ist::benchmark::write_table(document, "extent", table + "\n" + points) ? 0 : 1;
}
