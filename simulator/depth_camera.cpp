#include "depth_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ist::sim {
namespace {

constexpr double kNothing = std::numeric_limits<double>::infinity();
constexpr double kJump = 0.05;  // [m] a larger difference of neighbours is an edge

}  // namespace

DepthCamera::DepthCamera(const DepthCameraConfig& config, const std::vector<Body>& background)
    : config_(config),
      background_(static_cast<std::size_t>(config.width) * static_cast<std::size_t>(config.height),
                  kNothing) {
  for (const Body& body : background) draw(body, &background_);
}

Eigen::Vector3d DepthCamera::ray(int column, int row) const {
  return {(column - 0.5 * (config_.width - 1)) / config_.focal_length,
          (row - 0.5 * (config_.height - 1)) / config_.focal_length, 1.0};
}

bool DepthCamera::has_in_view(const Eigen::Vector3d& p_F) const {
  const Eigen::Vector3d p_C = config_.X_FC.inverse() * p_F;
  if (p_C.z() < config_.min_depth || p_C.z() > config_.max_depth) return false;
  const Eigen::Vector2d pixel = config_.focal_length * p_C.head<2>() / p_C.z();
  return std::abs(pixel.x()) < 0.5 * config_.width && std::abs(pixel.y()) < 0.5 * config_.height;
}

void DepthCamera::draw(const Body& body, std::vector<double>* depth) const {
  const Eigen::Isometry3d X_CS = config_.X_FC.inverse() * body.X_FS;
  const Eigen::Isometry3d X_SC = X_CS.inverse();
  const Eigen::Vector3d c = X_CS * body.shape->center();
  const double r = body.shape->radius();
  if (c.z() + r <= 0.0) return;
  int first[2] = {0, 0}, last[2] = {config_.width - 1, config_.height - 1};
  for (int k = 0; k < 2 && c.z() > r; ++k) {
    // Projects the corners of a box about the bounding sphere.
    const double near = c.z() - r, far = c.z() + r;
    const double low = std::min((c[k] - r) / near, (c[k] - r) / far);
    const double high = std::max((c[k] + r) / near, (c[k] + r) / far);
    const double middle = 0.5 * last[k];
    first[k] = std::max(
        first[k], static_cast<int>(std::ceil(std::max(low * config_.focal_length + middle, -1.0))));
    last[k] = std::min(last[k], static_cast<int>(std::floor(std::min(
                                    high * config_.focal_length + middle, last[k] + 1.0))));
  }
  Ray ray_S;
  ray_S.origin = X_SC.translation();
  for (int row = first[1]; row <= last[1]; ++row) {
    for (int column = first[0]; column <= last[0]; ++column) {
      ray_S.direction = X_SC.linear() * ray(column, row);
      double& at = (*depth)[static_cast<std::size_t>(row * config_.width + column)];
      at = std::min(at, body.shape->hit(ray_S));
    }
  }
}

void DepthCamera::fly(Rng* rng, std::vector<double>* depth) const {
  const std::vector<double> solid = *depth;
  std::uniform_real_distribution<double> uniform;
  for (int row = 0; row < config_.height; ++row) {
    for (int column = 0; column + 1 < config_.width; ++column) {
      const auto at = static_cast<std::size_t>(row * config_.width + column);
      const double a = solid[at], b = solid[at + 1];
      if (!(std::abs(a - b) > kJump) || !std::isfinite(a + b)) continue;
      if (uniform(*rng) < config_.flying_pixels) (*depth)[at] = a + uniform(*rng) * (b - a);
    }
  }
}

std::vector<Eigen::Vector3f> DepthCamera::picture(const std::vector<Body>& bodies, Rng* rng) const {
  std::vector<double> depth = background_;
  for (const Body& body : bodies) draw(body, &depth);
  if (config_.flying_pixels > 0.0) fly(rng, &depth);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3f> points(
      depth.size(), Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  for (int row = 0; row < config_.height; ++row) {
    for (int column = 0; column < config_.width; ++column) {
      const auto at = static_cast<std::size_t>(row * config_.width + column);
      if (!std::isfinite(depth[at])) continue;
      const double z = depth[at] + config_.noise * normal(*rng);
      if (z < config_.min_depth || z > config_.max_depth) continue;
      points[at] = (z * ray(column, row)).cast<float>();
    }
  }
  return points;
}

Eigen::Isometry3d looking_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Isometry3d X_FC = Eigen::Isometry3d::Identity();
  X_FC.linear() << x, z.cross(x), z;
  X_FC.translation() = eye;
  return X_FC;
}

}  // namespace ist::sim
