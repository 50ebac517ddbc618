#include "peers/image_pyramid.h"

#include <cmath>

namespace ist::benchmark {
namespace {

// A point as the message holds it, with its padding: one SIMD register.
using Quad = float __attribute__((vector_size(16)));

Quad load(const float* p) {
  Quad quad;
  __builtin_memcpy(&quad, p, sizeof quad);
  return quad;
}

Eigen::Vector3f vector(const Quad& quad) { return {quad[0], quad[1], quad[2]}; }

// The box and the sphere of a square of pixels. NaN compares as false and changes nothing.
void bound_pixels(const Frame& frame, std::size_t u0, std::size_t v0, GroupSphere* sphere,
                  Eigen::AlignedBox3f* box) {
  constexpr float kMax = std::numeric_limits<float>::max();
  const std::size_t u1 = std::min(u0 + ImagePyramid::kSide, frame.width),
                    v1 = std::min(v0 + ImagePyramid::kSide, frame.height);
  Quad low = {kMax, kMax, kMax, kMax}, high = -low;
  for (std::size_t v = v0; v < v1; ++v) {
    for (std::size_t u = u0; u < u1; ++u) {
      const Quad p = load(&frame.data[4 * (v * frame.width + u)]);
      low = p < low ? p : low;
      high = p > high ? p : high;
    }
  }
  if (low[0] > high[0]) {
    sphere->radius = -1.0F;
    box->setEmpty();
    return;
  }
  const Quad middle = 0.5F * (low + high);
  float radius_sq = 0.0F;
  for (std::size_t v = v0; v < v1; ++v) {
    for (std::size_t u = u0; u < u1; ++u) {
      const Quad d = load(&frame.data[4 * (v * frame.width + u)]) - middle;
      const Quad sq = d * d;
      const float distance_sq = sq[0] + sq[1] + sq[2];
      radius_sq = distance_sq > radius_sq ? distance_sq : radius_sq;
    }
  }
  *sphere = {vector(middle), 1.00001F * std::sqrt(radius_sq)};
  *box = Eigen::AlignedBox3f(vector(low), vector(high));
}

// The box and the sphere of up to four squares.
void bound_squares(const ImagePyramid::Level& below, std::size_t u0, std::size_t v0,
                   GroupSphere* sphere, Eigen::AlignedBox3f* box) {
  const std::size_t u1 = std::min(u0 + 2, below.width), v1 = std::min(v0 + 2, below.height);
  box->setEmpty();
  for (std::size_t v = v0; v < v1; ++v) {
    for (std::size_t u = u0; u < u1; ++u) {
      if (below.at(u, v).radius >= 0.0F) box->extend(below.boxes[v * below.width + u]);
    }
  }
  sphere->radius = -1.0F;
  if (box->isEmpty()) return;
  sphere->center = box->center();
  float radius = 0.0F;
  for (std::size_t v = v0; v < v1; ++v) {
    for (std::size_t u = u0; u < u1; ++u) {
      const GroupSphere& part = below.at(u, v);
      if (part.radius < 0.0F) continue;
      radius = std::max(radius, (part.center - sphere->center).norm() + part.radius);
    }
  }
  sphere->radius = 1.00001F * std::min(radius, 0.5F * box->diagonal().norm());
}

// As many squares as `side` of the level below, or pixels, fit into it.
void resize(std::size_t width, std::size_t height, std::size_t side, ImagePyramid::Level* level) {
  level->width = (width + side - 1) / side;
  level->height = (height + side - 1) / side;
  level->spheres.resize(level->width * level->height);
  level->boxes.resize(level->spheres.size());
}

}  // namespace

void ImagePyramid::build(const Frame& frame) {
  frame_ = &frame;
  std::size_t count = 1;
  for (std::size_t side = kSide; side < std::max(frame.width, frame.height); side *= 2) ++count;
  levels_.resize(count);
  resize(frame.width, frame.height, kSide, &levels_[0]);
  for (std::size_t v = 0; v < levels_[0].height; ++v) {
    for (std::size_t u = 0; u < levels_[0].width; ++u) {
      const std::size_t i = v * levels_[0].width + u;
      bound_pixels(frame, kSide * u, kSide * v, &levels_[0].spheres[i], &levels_[0].boxes[i]);
    }
  }
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    const Level& below = levels_[l - 1];
    Level& level = levels_[l];
    resize(below.width, below.height, 2, &level);
    for (std::size_t v = 0; v < level.height; ++v) {
      for (std::size_t u = 0; u < level.width; ++u) {
        const std::size_t i = v * level.width + u;
        bound_squares(below, 2 * u, 2 * v, &level.spheres[i], &level.boxes[i]);
      }
    }
  }
}

}  // namespace ist::benchmark
