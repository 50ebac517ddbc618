#include "support/images.h"

#include <memory>
#include <random>
#include <stdexcept>
#include <string>

namespace ist::test {

Eigen::Map<Eigen::Vector3f> Image::at(std::size_t i) {
  return Eigen::Map<Eigen::Vector3f>(&data[4 * i]);
}

Eigen::Vector3d Image::point(std::size_t i) const {
  return Eigen::Map<const Eigen::Vector3f>(&data[4 * i]).cast<double>();
}

RawCloud Image::raw() const {
  RawCloud cloud = packed_cloud(data.data(), width, height, 4);
  cloud.owner = std::shared_ptr<const void>(std::shared_ptr<void>(), data.data());
  return cloud;
}

Image wall(std::size_t width, std::size_t height, double noise, Rng* rng) {
  Image image{width, height, std::vector<float>(4 * width * height)};
  std::normal_distribution<double> normal(0.0, noise > 0.0 ? noise : 1.0);
  for (std::size_t i = 0; i < width * height; ++i) {
    const double u = static_cast<double>(i % width) / static_cast<double>(width) - 0.5;
    const double v = static_cast<double>(i / width) / static_cast<double>(width) - 0.5;
    const double depth = (u < 0.1 ? 1.0 : 1.2) + (noise > 0.0 ? normal(*rng) : 0.0);
    image.at(i) = (depth * Eigen::Vector3d(u, v, 1.0)).cast<float>();
  }
  return image;
}

std::shared_ptr<const DepthRays> rays_of(const CameraModel& camera) {
  std::shared_ptr<const DepthRays> rays;
  const std::string fault = check_camera(camera, &rays);
  if (!fault.empty()) throw std::invalid_argument(fault);
  return rays;
}

RawCloud depth_cloud(const std::shared_ptr<const DepthRays>& rays, Span<const float> depths) {
  DepthImage image;
  image.encoding = "32FC1";
  image.width = static_cast<std::uint32_t>(rays->x.size());
  image.height = static_cast<std::uint32_t>(rays->y.size());
  image.step = 4 * image.width;
  image.data = reinterpret_cast<const std::uint8_t*>(depths.data());
  image.data_size = 4 * depths.size();
  RawCloud cloud;
  const std::string fault = check_depth_image(image, rays, &cloud);
  if (!fault.empty()) throw std::invalid_argument(fault);
  return cloud;
}

}  // namespace ist::test
