#include "support/contact_oracle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "contact/contact_spheres.h"
#include "contact/lens.h"
#include "ist_proximity/cloud/ingest.h"
#include "support/random_links.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist::test {
namespace {

// A sphere of the obstacle and its weight, in the link's frame.
void oracle_add(const std::vector<OracleSphere>& spheres, const Eigen::Vector3d& center,
                double radius, double weight, ContactVolume* sum) {
  for (const OracleSphere& sphere : spheres) {
    const double volume = weight * sphere.cell_ratio *
                          oracle_lens(sphere.radius, radius, (center - sphere.center).norm());
    if (!(volume > 0.0)) continue;
    const Eigen::Vector3d middle = oracle_lens_middle(sphere.center, sphere.radius, center, radius);
    const Eigen::Vector3d push = -volume * sphere.outward_at(middle);
    sum->volume += volume;
    sum->weighted_normal += push;
    sum->weighted_moment += middle.cross(push);
  }
}

std::vector<Eigen::Vector3d> points_F(const CloudSnapshot& cloud) {
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, p] : thinned_points_of(cloud.index)) points.push_back(p);
  return points;
}

// The factor that a sphere's depth in the link gives its weight.
double oracle_depth_weight(const LinkModel& link, const Eigen::Vector3d& p_L, double radius) {
  double depth = 0.0;
  for (const InnerSphere& sphere : link.packing.spheres) {
    depth = std::max(depth, sphere.radius - (p_L - sphere.center).norm());
  }
  return std::min(depth / (kFullDepth * radius), 1.0);
}

// The contact volume of two links, from all pairs of spheres.
ContactVolume oracle_lenses(const ContactGeometry& a, const ContactGeometry& b,
                            const Eigen::Isometry3d& X_AB) {
  ContactVolume sum;
  const std::vector<OracleSphere> second = spheres_of(b);
  for (const OracleSphere& sphere : spheres_of(a)) {
    for (const OracleSphere& other : second) {
      const Eigen::Vector3d center = X_AB * other.center;
      const double volume =
          sphere.cell_ratio * other.cell_ratio *
          oracle_lens(sphere.radius, other.radius, (center - sphere.center).norm());
      if (!(volume > 0.0)) continue;
      const Eigen::Vector3d middle =
          oracle_lens_middle(sphere.center, sphere.radius, center, other.radius);
      const Eigen::Vector3d push =
          0.5 * volume *
          (X_AB.linear() * other.outward_at(X_AB.inverse() * middle) - sphere.outward_at(middle));
      sum.volume += volume;
      sum.weighted_normal += push;
      sum.weighted_moment += middle.cross(push);
    }
  }
  return sum;
}

// What all elements of a link have inside another one, each measured alone.
// @param X_AB  frame of the elements -> frame A of the other link
// @returns in A, about its origin
ContactVolume oracle_elements(const ContactGeometry& elements, const ContactGeometry& other,
                              const Eigen::Isometry3d& X_AB) {
  ContactVolume sum;
  for (const VolumeElement& element : elements.spheres->elements.elements()) {
    const Eigen::Vector3d p = X_AB * element.center.cast<double>();
    const SignedDistance found = other.spheres->solid.signed_distance(p);
    const Eigen::Matrix3d covariance =
        X_AB.linear() * element.covariance.cast<double>() * X_AB.linear().transpose();
    const double width = std::sqrt(12.0 * found.normal.dot(covariance * found.normal));
    const double share = std::clamp(0.5 - found.distance / width, 0.0, 1.0);
    const double volume = share * static_cast<double>(element.volume);
    const Eigen::Vector3d outward = X_AB.linear() * element.outward.cast<double>();
    const double outside = std::max(1.0 - 2.0 * share, 0.0);
    const Eigen::Vector3d force = volume * ((1.0 - outside) * outward - outside * found.normal);
    sum.volume += volume;
    sum.weighted_normal += force;
    sum.weighted_moment += (p - 0.5 * (1.0 - share) * width * found.normal).cross(force);
  }
  return sum;
}

}  // namespace

Eigen::Vector3d OracleSphere::outward_at(const Eigen::Vector3d& p) const {
  const Eigen::Vector3d o = outward + gradient * (p - center);
  return o / std::sqrt(o.squaredNorm() + 0.2 * 0.2);
}

std::vector<OracleSphere> spheres_of(const ContactGeometry& body) {
  std::vector<OracleSphere> spheres;
  if (!body.has_volume()) return spheres;
  for (const ContactLeaf& leaf : body.spheres->leaves) {
    for (int k = 0; k < kSphereWidth; ++k) {
      if (!(leaf.radius[k] > 0.0F)) continue;
      OracleSphere sphere{
          {leaf.x[k], leaf.y[k], leaf.z[k]}, leaf.radius[k], leaf.cell_ratio[k], {}, {}};
      for (int i = 0; i < 3; ++i) sphere.outward[i] = leaf.outward[i][k];
      for (int i = 0; i < 9; ++i) sphere.gradient(i / 3, i % 3) = leaf.gradient[i][k];
      spheres.push_back(sphere);
    }
  }
  return spheres;
}

Eigen::Vector3d oracle_lens_middle(const Eigen::Vector3d& a, double R, const Eigen::Vector3d& b,
                                   double r) {
  const double d = (b - a).norm();
  if (!(d > 0.0)) return a;
  const double low = std::max(-R, d - r), high = std::min(R, d + r);
  return a + 0.5 * (low + high) / d * (b - a);
}

double oracle_lens(double R, double r, double d) {
  if (d >= R + r) return 0.0;
  if (d <= std::abs(R - r)) return 4.0 * M_PI / 3.0 * std::pow(std::min(R, r), 3);
  return M_PI * (R + r - d) * (R + r - d) * (d * d + 2.0 * d * (R + r) - 3.0 * (R - r) * (R - r)) /
         (12.0 * d);
}

ContactVolume oracle_contact(const LinkModel& link, const ContactGeometry& body,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds) {
  const std::vector<OracleSphere> spheres = spheres_of(body);
  ContactVolume sum;
  for (const CloudSnapshot* cloud : clouds) {
    const double radius = kPointSphereRadius * cloud->thinning;
    for (const Eigen::Vector3d& p_F : points_F(*cloud)) {
      const Eigen::Vector3d p_L = X_FL.inverse() * p_F;
      const double weight = oracle_depth_weight(link, p_L, radius);
      if (!(weight > 0.0)) continue;
      double lenses = 0.0;
      for (const CloudSnapshot* other : clouds) {
        const double other_radius = kPointSphereRadius * other->thinning;
        for (const Eigen::Vector3d& q_F : points_F(*other)) {
          lenses += oracle_lens(radius, other_radius, (q_F - p_F).norm());
        }
      }
      const double own = 4.0 * M_PI / 3.0 * std::pow(radius, 3);
      oracle_add(spheres, p_L, radius, weight * own / lenses, &sum);
    }
  }
  return sum;
}

ContactVolume oracle_contact(const ContactGeometry& a, const ContactGeometry& b,
                             const Eigen::Isometry3d& X_AB) {
  const bool are_balls = a.packed_volume > 0.999 * a.volume && b.packed_volume > 0.999 * b.volume;
  if (are_balls) return oracle_lenses(a, b, X_AB);
  ContactVolume sum;
  sum.add(oracle_elements(b, a, X_AB), 0.5);
  const ContactVolume of_a = oracle_elements(a, b, X_AB.inverse());  // in B
  const Eigen::Vector3d force = X_AB.linear() * of_a.weighted_normal;
  sum.volume += 0.5 * of_a.volume;
  sum.weighted_normal -= 0.5 * force;
  sum.weighted_moment -=
      0.5 * (X_AB.linear() * of_a.weighted_moment + X_AB.translation().cross(force));
  return sum;
}

CloudSnapshot thinned(const std::vector<Eigen::Vector3d>& points, double thinning,
                      const Eigen::Vector3d& far) {
  std::vector<double> xyz;
  for (const Eigen::Vector3d& p : points) xyz.insert(xyz.end(), {p.x(), p.y(), p.z()});
  const RawCloud raw = packed_cloud(xyz.data(), points.size(), 1);
  IngestConfig config = whole_cloud();
  config.thinning = thinning;
  CloudSnapshot snapshot;
  Ingest(config).run(raw, Eigen::Isometry3d(Eigen::Translation3d(far)), {}, 0.0, &snapshot);
  return snapshot;
}

ContactLink::ContactLink(const LinkGeometry& link_geometry, int spheres, double max_error)
    : geometry(link_geometry), model(model_of({link_geometry}, max_error)) {
  ContactConfig config;
  config.packing.max_spheres = spheres;
  body = build_contact_geometry(geometry, 0, link(), config, "");
}

}  // namespace ist::test
