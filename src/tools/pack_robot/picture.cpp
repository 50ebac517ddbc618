#include "picture.h"

#include <png.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "ist_proximity/geometry/error.h"

namespace ist::tools {
namespace {

constexpr int kMaxPanelWidth = 720, kPanelHeight = 720, kMargin = 20;
constexpr int kOversampling = 2;  // per axis

// The axes of the view as rows: to the right, up, towards the eye.
Eigen::Matrix3d view() {
  const Eigen::Vector3d eye = Eigen::Vector3d(1.0, -1.6, 0.8).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(eye).normalized();
  Eigen::Matrix3d R;
  R << right.transpose(), eye.cross(right).transpose(), eye.transpose();
  return R;
}

// Neighbouring links have very different hues: they differ by the golden angle.
Eigen::Vector3d link_color(std::size_t link) {
  const double hue = std::fmod(0.58 + 0.381966 * static_cast<double>(link), 1.0);
  Eigen::Vector3d color;
  for (int k = 0; k < 3; ++k) {
    const double h = std::fmod(6.0 * hue + 2.0 * (3 - k), 6.0);
    color[k] = 0.45 + 0.5 * std::clamp(std::abs(h - 3.0) - 1.0, 0.0, 1.0);
  }
  return color;
}

class Canvas {
 public:
  Canvas(int width, int height)
      : width_(width),
        height_(height),
        color_(static_cast<std::size_t>(width * height), Eigen::Vector3d::Ones()),
        depth_(color_.size(), -std::numeric_limits<double>::infinity()) {}

  // Draws a sphere, given in pixels: x to the right, y up, z towards the eye. Only pixels of the
  // columns from `left` to `right` are drawn.
  void sphere(const Eigen::Vector3d& c, double radius, const Eigen::Vector3d& color, int left,
              int right) {
    const Eigen::Vector3d light = Eigen::Vector3d(-0.5, 0.6, 0.8).normalized();
    const int x0 = std::max(left, static_cast<int>(std::floor(c.x() - radius)));
    const int x1 = std::min(right - 1, static_cast<int>(std::ceil(c.x() + radius)));
    const int y0 = std::max(0, static_cast<int>(std::floor(c.y() - radius)));
    const int y1 = std::min(height_ - 1, static_cast<int>(std::ceil(c.y() + radius)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const double dx = x - c.x(), dy = y - c.y();
        const double dz_sq = radius * radius - dx * dx - dy * dy;
        if (dz_sq < 0.0) continue;
        const double z = c.z() + std::sqrt(dz_sq);
        const auto at = static_cast<std::size_t>((height_ - 1 - y) * width_ + x);
        if (z <= depth_[at]) continue;
        depth_[at] = z;
        const Eigen::Vector3d n = Eigen::Vector3d(dx, dy, z - c.z()) / radius;
        color_[at] = (0.35 + 0.65 * std::max(0.0, n.dot(light))) * color;
      }
    }
  }

  void write(const std::string& path) const {
    const int w = width_ / kOversampling, h = height_ / kOversampling;
    std::vector<std::uint8_t> bytes;
    bytes.reserve(static_cast<std::size_t>(3 * w * h));
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int k = 0; k < kOversampling * kOversampling; ++k) {
          const int row = kOversampling * y + k / kOversampling;
          sum += color_[static_cast<std::size_t>(row * width_ + kOversampling * x +
                                                 k % kOversampling)];
        }
        sum *= 255.0 / (kOversampling * kOversampling);
        for (int k = 0; k < 3; ++k) bytes.push_back(static_cast<std::uint8_t>(sum[k]));
      }
    }
    png_image image = {};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(w);
    image.height = static_cast<png_uint_32>(h);
    image.format = PNG_FORMAT_RGB;
    if (png_image_write_to_file(&image, path.c_str(), 0, bytes.data(), 0, nullptr) == 0) {
      throw ModelError("cannot write '" + path + "': " + image.message);
    }
  }

 private:
  int width_, height_;
  std::vector<Eigen::Vector3d> color_;
  std::vector<double> depth_;
};

struct PlacedSphere {
  Eigen::Vector3d center;  // [m] in the view
  double radius;
  std::size_t link;
};

std::vector<PlacedSphere> placed(const Input& input, const RobotModel& model) {
  const Eigen::Matrix3d R = view();
  std::vector<PlacedSphere> spheres;
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    const auto pose = input.X_RL.find(model.links[l].name);
    for (const InnerSphere& sphere : model.links[l].packing.spheres) {
      const Eigen::Vector3d c =
          pose == input.X_RL.end() ? sphere.center : Eigen::Vector3d(pose->second * sphere.center);
      spheres.push_back({R * c, std::max(sphere.radius, 0.0), l});
    }
  }
  return spheres;
}

}  // namespace

void draw(const Input& input, const std::vector<std::shared_ptr<const RobotModel>>& models,
          const std::string& path) {
  std::vector<std::vector<PlacedSphere>> panels;
  Eigen::AlignedBox2d box;
  for (const auto& model : models) {
    panels.push_back(placed(input, *model));
    for (const PlacedSphere& sphere : panels.back()) {
      box.extend(Eigen::Vector2d(sphere.center.head<2>().array() - sphere.radius));
      box.extend(Eigen::Vector2d(sphere.center.head<2>().array() + sphere.radius));
    }
  }
  if (box.isEmpty()) throw ModelError("there is nothing to draw: no link was packed");
  const double aspect = box.sizes().x() / std::max(box.sizes().y(), 1e-9);
  const int panel = std::clamp(2 * kMargin + static_cast<int>(aspect * kPanelHeight),
                               kPanelHeight / 4, kMaxPanelWidth);
  const int width = kOversampling * panel, height = kOversampling * kPanelHeight;
  const double margin = kOversampling * kMargin;
  const double scale = std::min((width - 2 * margin) / std::max(box.sizes().x(), 1e-9),
                                (height - 2 * margin) / std::max(box.sizes().y(), 1e-9));
  Canvas canvas(width * static_cast<int>(panels.size()), height);
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const int left = width * static_cast<int>(p);
    const Eigen::Vector3d middle(left + 0.5 * width, 0.5 * height, 0.0);
    for (const PlacedSphere& sphere : panels[p]) {
      Eigen::Vector3d c = sphere.center;
      c.head<2>() -= box.center();
      // Spheres of radius 0 are drawn as points.
      canvas.sphere(middle + scale * c, std::max(scale * sphere.radius, 1.0),
                    link_color(sphere.link), left, left + width);
    }
  }
  canvas.write(path);
}

}  // namespace ist::tools
