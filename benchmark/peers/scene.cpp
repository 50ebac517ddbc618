#include "peers/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "ist_proximity/geometry/shapes.h"

namespace ist::benchmark {

RawCloud Frame::raw() const {
  RawCloud cloud = packed_cloud(data.data(), width, height, 4);
  // The frame does not change while its snapshots are queried.
  cloud.owner = std::shared_ptr<const void>(std::shared_ptr<void>(), data.data());
  return cloud;
}

Frame next_image(const Frame& frame, double noise, std::mt19937_64* rng) {
  Frame next = frame;
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < next.data.size(); i += 4) {
    const auto z = static_cast<double>(next.data[i + 2]);
    const auto scale = static_cast<float>(1.0 + noise * z * normal(*rng));
    for (std::size_t k = 0; k < 3; ++k) next.data[i + k] *= scale;
  }
  return next;
}

void Points::read(const Frame& frame) {
  const std::size_t n = frame.width * frame.height;
  x.resize(n);
  y.resize(n);
  z.resize(n);
  const Eigen::Matrix3f R = frame.X_FS.linear().cast<float>();
  const Eigen::Vector3f t = frame.X_FS.translation().cast<float>();
  std::size_t used = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3f p =
        R * Eigen::Vector3f(frame.data[4 * i], frame.data[4 * i + 1], frame.data[4 * i + 2]) + t;
    x[used] = p.x();
    y[used] = p.y();
    z[used] = p.z();
    used += std::isfinite(p.x() + p.y() + p.z()) ? 1 : 0;
  }
  x.resize(used);
  y.resize(used);
  z.resize(used);
}

std::shared_ptr<const RobotModel> Robot::pack(double max_error, int max_spheres) const {
  RobotDescription description;
  for (const TriangleMesh& mesh : meshes) {
    LinkDescription link;
    link.name = "link" + std::to_string(description.links.size());
    link.geometry = {GeometryElement{mesh, Eigen::Isometry3d::Identity(), link.name}};
    description.links.push_back(std::move(link));
  }
  RobotModelConfig config;
  config.distance_fields = true;  // as the node has them
  config.packing.max_error = max_error;
  config.packing.max_spheres = max_spheres;
  config.cache_directory = cache_directory;
  return build_robot_model(description, config);
}

std::size_t SphereSet::size() const {
  std::size_t count = 0;
  for (const auto& link : links) count += link.size();
  return count;
}

SphereSet few_spheres(const Robot& robot, std::size_t wanted) {
  const auto count = [](const RobotModel& model) {
    std::size_t spheres = 0;
    for (const LinkModel& link : model.links) spheres += link.packing.spheres.size();
    return spheres;
  };
  double low = 0.002, high = 0.2;  // [m] with many and with few spheres
  std::shared_ptr<const RobotModel> best;
  const auto miss = [&](const RobotModel& model) {
    return std::abs(static_cast<double>(count(model)) - static_cast<double>(wanted));
  };
  for (int i = 0; i < 8; ++i) {
    const double middle = std::sqrt(low * high);
    const auto model = robot.pack(middle);
    if (!best || miss(*model) < miss(*best)) best = model;
    (count(*model) > wanted ? low : high) = middle;
  }
  SphereSet set;
  for (const LinkModel& link : best->links) {
    std::vector<SphereSet::Sphere> spheres;
    for (const InnerSphere& sphere : link.packing.spheres)
      spheres.push_back({sphere.center, sphere.radius});
    set.links.push_back(std::move(spheres));
    set.gap = std::max(set.gap, link.packing.certificate.max_gap);
  }
  return set;
}

std::vector<std::vector<Eigen::Isometry3d>> interpolated(
    const std::vector<std::vector<Eigen::Isometry3d>>& poses, int steps) {
  std::vector<std::vector<Eigen::Isometry3d>> motion;
  for (std::size_t k = 0; k + 1 < poses.size(); ++k) {
    for (int step = 0; step < steps; ++step) {
      const double s = static_cast<double>(step) / steps;
      std::vector<Eigen::Isometry3d> X_FL;
      for (std::size_t i = 0; i < poses[k].size(); ++i) {
        const Eigen::Isometry3d &a = poses[k][i], &b = poses[k + 1][i];
        const Eigen::Quaterniond q(a.linear()), r(b.linear());
        Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
        X.linear() = q.normalized().slerp(s, r.normalized()).toRotationMatrix();
        X.translation() = (1.0 - s) * a.translation() + s * b.translation();
        X_FL.push_back(X);
      }
      motion.push_back(std::move(X_FL));
    }
  }
  return motion;
}

}  // namespace ist::benchmark
