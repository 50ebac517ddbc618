#include "peers/scene.h"

#include <cmath>
#include <memory>
#include <random>

#include "support/robot_of_links.h"

namespace ist::benchmark {

RawCloud Frame::raw() const {
  RawCloud cloud = packed_cloud(data.data(), width, height, 4);
  // The frame does not change while its snapshots are queried.
  cloud.owner = std::shared_ptr<const void>(std::shared_ptr<void>(), data.data());
  return cloud;
}

Frame make_frame(const std::vector<Eigen::Vector3f>& points, const Eigen::Isometry3d& X_FS) {
  Frame frame{640, points.size() / 640, {}, X_FS};
  for (const Eigen::Vector3f& p : points) {
    frame.data.insert(frame.data.end(), {p.x(), p.y(), p.z(), 0.0F});
  }
  return frame;
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

void read_points(const Frame& frame, std::vector<Eigen::Vector3f>* points) {
  const Eigen::Isometry3f X_FS = frame.X_FS.cast<float>();
  points->resize(frame.size());
  std::size_t used = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    Eigen::Vector3f& p = (*points)[used];
    p = X_FS * frame.point(i);
    used += std::isfinite(p.sum()) ? 1 : 0;
  }
  points->resize(used);
}

std::shared_ptr<const RobotModel> packed(const RobotDescription& robot,
                                         const std::string& cache_directory, double max_error) {
  RobotModelConfig config;
  config.distance_fields = true;
  config.packing.max_error = max_error;
  config.cache_directory = cache_directory;
  return build_robot_model(robot, config);
}

std::shared_ptr<const RobotModel> Robot::pack(double max_error) const {
  std::vector<LinkGeometry> links;
  for (const TriangleMesh& mesh : meshes) {
    links.push_back({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "mesh"}});
  }
  return packed(test::robot_of(links), cache_directory, max_error);
}

std::vector<Poses> interpolated(const std::vector<Poses>& poses, int steps) {
  std::vector<Poses> motion;
  for (std::size_t k = 0; k + 1 < poses.size(); ++k) {
    for (int step = 0; step < steps; ++step) {
      const double s = static_cast<double>(step) / steps;
      Poses X_FL;
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
