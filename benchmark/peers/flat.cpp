#include "peers/flat.h"

#include <algorithm>
#include <limits>

namespace ist::benchmark {
namespace {

IST_BENCHMARK_SIMD void box_pass(const float* x, const float* y, const float* z, std::size_t n,
                                 const float* R, const float* t, const float* low,
                                 const float* high, float* out) {
  for (std::size_t i = 0; i < n; ++i) {
    float sum = 0.0F;
    for (int k = 0; k < 3; ++k) {
      const float p = R[3 * k] * x[i] + R[3 * k + 1] * y[i] + R[3 * k + 2] * z[i] + t[k];
      const float below = low[k] - p, above = p - high[k];
      const float out_of = below > above ? below : above;
      const float gap = out_of > 0.0F ? out_of : 0.0F;
      sum += gap * gap;
    }
    out[i] = sum;
  }
}

}  // namespace

void box_distances_sq(const Points& points, const Eigen::Isometry3d& X_LF,
                      const Eigen::AlignedBox3f& box, std::vector<float>* distances_sq) {
  distances_sq->resize(points.size());
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> R = X_LF.linear().cast<float>();
  const Eigen::Vector3f t = X_LF.translation().cast<float>();
  box_pass(points.x.data(), points.y.data(), points.z.data(), points.size(), R.data(), t.data(),
           box.min().data(), box.max().data(), distances_sq->data());
}

void BySpheres::query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) {
  for (std::size_t link = 0; link < X_FL.size(); ++link) {
    Answer& best = (*answers)[link];
    best.distance = std::numeric_limits<double>::infinity();
    for (const SphereSet::Sphere& sphere : set_.links[link]) {
      const Eigen::Vector3d center = X_FL[link] * sphere.center;
      const double max_distance = best.distance + sphere.radius;
      Nearest found;
      if (max_distance <= 0.0 || !nearest(center, max_distance, &found) ||
          found.distance >= max_distance)
        continue;
      const Eigen::Vector3d offset = found.p_FCo - center;
      const double length = offset.norm();
      const Eigen::Vector3d direction = length > 0.0 ? Eigen::Vector3d(offset / length)
                                                     : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
      best = {found.distance - sphere.radius, center + sphere.radius * direction, found.p_FCo};
    }
  }
}

PrunedByBox::PrunedByBox(const Robot& robot) : last_(robot.meshes.size(), 0) {
  kind = Kind::kExact;
  is_unsigned = true;
  for (const TriangleMesh& mesh : robot.meshes) {
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v.cast<float>());
    boxes_.push_back(box);
  }
}

void PrunedByBox::ingest(const Frame& frame) { points_.read(frame); }

void PrunedByBox::query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) {
  for (std::size_t link = 0; link < X_FL.size(); ++link) {
    const Eigen::Isometry3d X_LF = X_FL[link].inverse();
    const Eigen::Isometry3f X = X_LF.cast<float>();
    box_distances_sq(points_, X_LF, boxes_[link], &bound_sq_);
    float distance = std::numeric_limits<float>::infinity();
    Eigen::Vector3d surface_L = Eigen::Vector3d::Zero();
    std::size_t nearest = 0;
    const auto try_point = [&](std::size_t i) {
      if (closest(link, X * points_.at(i), &distance, &surface_L)) nearest = i;
    };
    try_point(std::min(last_[link], points_.size() - 1));
    try_point(static_cast<std::size_t>(std::min_element(bound_sq_.begin(), bound_sq_.end()) -
                                       bound_sq_.begin()));
    for (std::size_t i = 0; i < bound_sq_.size(); ++i) {
      if (bound_sq_[i] < distance * distance) try_point(i);
    }
    last_[link] = nearest;
    (*answers)[link] = {static_cast<double>(distance), X_FL[link] * surface_L,
                        points_.at(nearest).cast<double>()};
  }
}

}  // namespace ist::benchmark
