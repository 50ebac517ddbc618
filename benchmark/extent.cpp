// Lower bounds against true surfaces, with the extent of points and without, as Markdown tables.
//
// Simulated: spheres and a table seen by a depth camera with the published noise of a Kinect. Real:
// Kinect frames of tables, against planes fitted to them; from IST_PROXIMITY_DATA, or
// ../shared/data.

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "depth_camera.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "support/pcd.h"
#include "support/scene.h"

namespace {

using Eigen::Vector3d;
using ist::ExtentConfig;
using ist::benchmark::text_of;
using ist::test::Rng;
using ist::test::uniform;
using Points = std::vector<Eigen::Vector3f>;

constexpr double kMaxRange = 3.0;                 // [m]
constexpr std::array kSigmas = {0.0, 3.0};        // of the extent; 0: points
constexpr std::array kRadii = {0.01, 0.03, 0.1};  // [m] of the links
const ist::SensorModel& kModel = *ist::find_sensor_model("kinect_v1");

double sigma(double range) {
  return kModel.noise_constant + kModel.noise_quadratic * range * range;
}

// The answers of one configuration.
struct Tally {
  std::vector<double> gap;    // [m] true distance - lower bound, negative: the bound failed
  std::vector<double> width;  // [m] distance - lower_bound
};
using Tallies = std::array<Tally, kSigmas.size()>;

// A link at a place whose distance from the true surface is known.
struct Place {
  Vector3d center;
  double distance;  // [m]
  std::size_t link;
};

// What is stated of a camera's errors, and what they are.
struct Calibration {
  double offset = 0.0, angle = 0.0;  // [m], [rad]
};

ExtentConfig extent_of(double sigmas, const Calibration& calibration) {
  ExtentConfig config;
  if (sigmas == 0.0) return config;
  config.noise_constant = kModel.noise_constant;
  config.noise_quadratic = kModel.noise_quadratic;
  config.sigmas = sigmas;
  config.footprint = ExtentConfig::Footprint::kCamera;
  config.field_of_view = kModel.field_of_view;
  config.calibration = calibration.offset;
  config.calibration_angle = calibration.angle;
  return config;
}

// Asks links that are spheres: their distance to a shape is exact.
void measure(const Points& image, std::size_t width, const Eigen::Isometry3d& X_FS,
             const Calibration& calibration, const std::vector<Place>& places, Tallies* tallies) {
  static const auto model = ist::test::make_model(
      {ist::Sphere{kRadii[0]}, ist::Sphere{kRadii[1]}, ist::Sphere{kRadii[2]}}, 0.001);
  ist::ProximityQuery query(model, {});
  for (std::size_t k = 0; k < kSigmas.size(); ++k) {
    ist::IngestConfig config;
    config.max_range = kMaxRange;
    config.self_filter = false;
    config.extent = extent_of(kSigmas[k], calibration);
    ist::CloudSnapshot cloud;
    ist::Ingest(config).run(ist::packed_cloud(image.front().data(), width, image.size() / width),
                            X_FS, {}, 0.0, &cloud);
    for (const Place& place : places) {
      const Eigen::Isometry3d X_FL(Eigen::Translation3d(place.center));
      ist::LinkProximity answer;
      query.run_link(place.link, X_FL, {&cloud}, &answer);
      if (answer.state < ist::LinkState::kNear) continue;
      (*tallies)[k].gap.push_back(place.distance - kRadii[place.link] - answer.lower_bound);
      (*tallies)[k].width.push_back(answer.distance - answer.lower_bound);
    }
  }
}

std::string rows(const std::string& scene, const Tallies& tallies) {
  std::string text;
  for (std::size_t k = 0; k < kSigmas.size(); ++k) {
    const auto& gap = tallies[k].gap;
    const auto held = std::count_if(gap.begin(), gap.end(), [](double one) { return one >= 0.0; });
    const bool is_points = kSigmas[k] == 0.0;
    const std::string points = is_points ? "points" : text_of("k = %.0f", kSigmas[k]);
    // The share of a normal distribution within k standard deviations.
    const double stated = 100.0 * std::erf(kSigmas[k] / std::sqrt(2.0));
    text += text_of("| %s | %s | %zu | %.2f %% | %s | %.1f mm | %.1f mm |\n", scene.c_str(),
                    points.c_str(), gap.size(),
                    100.0 * static_cast<double>(held) / static_cast<double>(gap.size()),
                    is_points ? "-" : text_of("%.2f %%", stated).c_str(),
                    1e3 * std::max(0.0, -ist::benchmark::quantile(gap, 0.0)),
                    1e3 * ist::benchmark::mean(tallies[k].width));
  }
  return text;
}

// ---------------------------------------------------------------- simulated

// A table with balls on it, in the camera's frame (z forward).
class Scene {
 public:
  explicit Scene(Rng* rng) {
    const double tilt = uniform(rng, 0.3, 1.0);  // between the table's normal and the view
    normal_ = {0.0, -std::sin(tilt), -std::cos(tilt)};
    offset_ = -uniform(rng, 0.7, 1.8) * std::cos(tilt);
    for (std::size_t i = 0; i < 4; ++i) {
      const double z = uniform(rng, 0.7, 1.6);
      centers_.push_back({uniform(rng, -0.3, 0.3) * z, uniform(rng, -0.25, 0.25) * z, z});
      radii_.push_back(uniform(rng, 0.02, 0.12));
      shapes_.emplace_back(ist::Sphere{radii_[i]});
    }
    shapes_.emplace_back(ist::Box{{20.0, 20.0, kThickness}});
  }

  // The shapes, for as long as this is.
  std::vector<ist::sim::Body> bodies() const {
    std::vector<ist::sim::Body> all;
    for (std::size_t i = 0; i < centers_.size(); ++i) {
      all.push_back({&shapes_[i], Eigen::Isometry3d(Eigen::Translation3d(centers_[i]))});
    }
    const auto turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), normal_);
    const Vector3d middle = (offset_ - 0.5 * kThickness) * normal_;
    all.push_back({&shapes_.back(), Eigen::Translation3d(middle) * Eigen::Isometry3d(turn)});
    return all;
  }

  // [m] Signed distance of the nearest surface; positive outside.
  double distance(const Vector3d& p, Vector3d* nearest) const {
    double least = normal_.dot(p) - offset_;
    *nearest = p - least * normal_;
    for (std::size_t i = 0; i < centers_.size(); ++i) {
      const double d = (p - centers_[i]).norm() - radii_[i];
      if (d >= least) continue;
      least = d;
      *nearest = p - d * (p - centers_[i]).normalized();
    }
    return least;
  }

 private:
  static constexpr double kThickness = 0.1;  // [m] of the table

  Vector3d normal_;  // of the table, towards the camera
  double offset_;    // normal . p on the table
  std::vector<Vector3d> centers_;
  std::vector<double> radii_;
  std::vector<ist::sim::RayShape> shapes_;
};

bool hides(const ist::sim::Body& body, const Vector3d& p) {
  const Eigen::Isometry3d X_SF = body.X_FS.inverse();
  return body.shape->hit({X_SF.translation(), X_SF.linear() * p}) < 1.0 - 1e-9;
}

// Places whose nearest true surface the camera sees.
std::vector<Place> random_places(const Scene& scene, const ist::sim::DepthCamera& camera,
                                 Rng* rng) {
  constexpr std::size_t kPlaces = 100;
  const auto bodies = scene.bodies();
  std::vector<Place> places;
  while (places.size() < kPlaces) {
    const double z = uniform(rng, 0.5, 1.8);
    Place place{{uniform(rng, -0.4, 0.4) * z, uniform(rng, -0.3, 0.3) * z, z}, 0.0, 0};
    place.link = static_cast<std::size_t>(uniform(rng, 0, 2.999));
    Vector3d nearest;
    place.distance = scene.distance(place.center, &nearest);
    const double gap = place.distance - kRadii[place.link];
    if (gap < 0.005 || gap > 0.3 || !camera.has_in_view(nearest)) continue;
    if (std::any_of(bodies.begin(), bodies.end(),
                    [&](const ist::sim::Body& body) { return hides(body, nearest); })) {
      continue;
    }
    places.push_back(place);
  }
  return places;
}

// @param calibration  the largest errors, which are stated, too
std::string simulate(const std::string& name, int width, bool is_noisy,
                     const Calibration& calibration) {
  ist::sim::DepthCameraConfig config;
  config.width = width;
  config.height = width * 3 / 4;
  config.focal_length = 0.5 * (width - 1) / std::tan(0.5 * kModel.field_of_view);
  config.max_depth = kMaxRange;
  config.noise = 0.0;
  const ist::sim::DepthCamera camera(config, {});
  config.focal_length *= 50.0 / 49.0;
  const ist::sim::DepthCamera inner(config, {});  // without the outermost pixels
  Tallies tallies;
  Rng rng(19);
  for (int i = 0; i < 40; ++i) {
    const Scene scene(&rng);
    const Vector3d axis = ist::test::random_vector(&rng, 1.0).normalized();
    const double angle = uniform(&rng, -calibration.angle, calibration.angle);
    const double offset = uniform(&rng, 0.0, calibration.offset);
    const Vector3d way = ist::test::random_vector(&rng, 1.0).normalized();
    const Eigen::Isometry3d X_FS =
        Eigen::Translation3d(offset * way) * Eigen::Isometry3d(Eigen::AngleAxisd(angle, axis));
    std::normal_distribution<double> normal;
    Rng unused;
    Points image = camera.picture(scene.bodies(), &unused);
    for (Eigen::Vector3f& p : image) {
      const auto range = static_cast<double>(p.norm());
      if (!(range < kMaxRange)) continue;
      const double error = sigma(range) * normal(rng);
      if (is_noisy) p *= static_cast<float>(1.0 + error / range);
    }
    measure(image, static_cast<std::size_t>(width), X_FS, calibration,
            random_places(scene, inner, &rng), &tallies);
  }
  return rows(name, tallies);
}

// ---------------------------------------------------------------- real

struct Plane {
  Vector3d normal = Vector3d::Zero();  // towards the camera
  double offset = 0.0;
  double height(const Vector3d& p) const { return normal.dot(p) - offset; }
};

Plane fit(const std::vector<Vector3d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  Plane plane;
  plane.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  if (plane.normal.dot(mean) > 0.0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(mean);
  return plane;
}

std::vector<Vector3d> near_plane(const std::vector<Vector3d>& points, const Plane& plane,
                                 double within) {
  std::vector<Vector3d> near;
  for (const Vector3d& p : points) {
    if (std::abs(plane.height(p)) < within) near.push_back(p);
  }
  return near;
}

// The plane with the most points within 1 cm, then a least squares fit of those within 2 cm.
Plane find_table(const std::vector<Vector3d>& points, Rng* rng) {
  std::uniform_int_distribution<std::size_t> any(0, points.size() - 1);
  Plane best;
  std::size_t most = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d a = points[any(*rng)], b = points[any(*rng)], c = points[any(*rng)];
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
std::vector<Place> places_above(const std::vector<Vector3d>& points, const Plane& table,
                                std::size_t count, Rng* rng) {
  const std::vector<Vector3d> on_table = near_plane(points, table, 0.02);
  std::uniform_int_distribution<std::size_t> any(0, on_table.size() - 1);
  std::vector<Place> places;
  for (std::size_t i = 0; i < 100 * count && places.size() < count; ++i) {
    const Vector3d seen = on_table[any(*rng)];
    const Vector3d foot = seen - table.height(seen) * table.normal;
    Place place;
    place.link = static_cast<std::size_t>(uniform(rng, 0, 2.999));
    place.distance = kRadii[place.link] + uniform(rng, 0.005, 0.15);
    place.center = foot + place.distance * table.normal;
    // No other thing is as near, nor in the shape of a lower ground beside the table.
    int beside = 0;
    bool is_free = true;
    for (const Vector3d& p : points) {
      const double from_foot_sq = (p - foot).squaredNorm();
      beside += from_foot_sq < 0.03 * 0.03 ? 1 : 0;
      const bool near = (p - place.center).norm() < place.distance + 0.02;
      is_free = is_free && !(near && std::abs(table.height(p)) > 0.02);
    }
    if (is_free && beside > 50) places.push_back(place);
  }
  return places;
}

// @param residuals  [standard deviations] of points from the table, along their rays
void measure_frame(const Points& frame, std::vector<double>* residuals, Tallies* tallies) {
  Rng rng(7);
  std::vector<Vector3d> points;
  for (const Eigen::Vector3f& p : frame) {
    if (p.allFinite() && p.norm() < 1.8F) points.emplace_back(p.cast<double>());
  }
  const Plane table = find_table(points, &rng);
  for (const Vector3d& p : near_plane(points, table, 0.02)) {
    const double along = std::abs(table.normal.dot(p.normalized()));
    residuals->push_back(std::abs(table.height(p)) / along / sigma(p.norm()));
  }
  measure(frame, 640, Eigen::Isometry3d::Identity(), {}, places_above(points, table, 150, &rng),
          tallies);
}

std::string measure_real(const std::filesystem::path& data) {
  Tallies tallies;
  std::vector<double> residuals;
  for (const char* name : {"mosd0.pcd", "mosd10.pcd", "mosd40.pcd"}) {
    measure_frame(ist::test::read_pcd((data / "clouds" / name).string()), &residuals, &tallies);
  }
  const auto within = [&](double k) {
    const auto count =
        std::count_if(residuals.begin(), residuals.end(), [k](double error) { return error <= k; });
    return 100.0 * static_cast<double>(count) / static_cast<double>(residuals.size());
  };
  return rows("real Kinect, tables", tallies) +
         text_of(
             "\nOf %zu points of the real tables, %.2f %%, %.2f %% and %.2f %% are within 1, 2 and "
             "3 standard deviations of the plane.\n",
             residuals.size(), within(1.0), within(2.0), within(3.0));
}

}  // namespace

int main(int argc, char** argv) {
  ist::benchmark::CommandLine line("Lower bounds against true surfaces, for points with extent.");
  line.read(argc, argv);
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const std::string table =
      "| scene | points are | cases | `lower_bound` holds | at least | worst | interval, mean |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n" +
      simulate("320 x 240, noise", 320, true, {}) + simulate("80 x 60, no noise", 80, false, {}) +
      simulate("80 x 60, noise", 80, true, {}) +
      simulate("320 x 240, noise, calibration", 320, true, {0.005, 0.005}) + measure_real(data);
  return line.publish("extent", table);
}
