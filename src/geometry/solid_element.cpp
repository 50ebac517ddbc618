#include "geometry/solid_element.h"

#include <cmath>

#include "geometry/primitive_distance.h"
#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/tessellation.h"

namespace ist {
namespace {

std::vector<Eigen::Vector3d> face_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d n =
        (mesh.corner(t, 1) - mesh.corner(t, 0)).cross(mesh.corner(t, 2) - mesh.corner(t, 0));
    const double norm = n.norm();
    normals.push_back(norm > 0.0 ? Eigen::Vector3d(n / norm) : Eigen::Vector3d::Zero());
  }
  return normals;
}

// A point on the surface gets the face's normal, reversed where the mesh has the face inside out.
Eigen::Vector3d normal_at_touch(const TriangleBvh& bvh, const Eigen::Vector3d& face_normal,
                                const Eigen::Vector3d& witness) {
  if (face_normal.isZero()) return Eigen::Vector3d::UnitZ();
  const double step = 1e-6 * (1.0 + bvh.bounds().sizes().norm());
  const double front = bvh.winding_number(witness + step * face_normal);
  const double back = bvh.winding_number(witness - step * face_normal);
  return front <= back ? face_normal : Eigen::Vector3d(-face_normal);
}

}  // namespace

SolidElement::SolidElement(const GeometryElement& source, const CancelRequest& cancelled)
    : primitive(TriangleMesh{}), X_LE(source.X_LE), X_EL(source.X_LE.inverse()) {
  if (const auto* mesh = std::get_if<TriangleMesh>(&source.shape)) {
    bvh = TriangleBvh(*mesh, cancelled);
    normals = face_normals(*mesh);
    boundary = ist::open_edges(*mesh, cancelled);
    is_closed = boundary.empty();
    if (!is_closed) open_edges = OpenEdgeHierarchy(*mesh, boundary, cancelled);
    return;
  }
  primitive = source.shape;
  if (const auto* box = std::get_if<Box>(&source.shape)) {
    box_sides = TriangleBvh(tessellate(*box).mesh);
  }
}

bool SolidElement::is_inside(const Eigen::Vector3d& p_E) const {
  if (!is_mesh()) return primitive_distance(primitive, p_E).distance < 0.0;
  return bvh.bounds().contains(p_E) && bvh.is_inside(p_E);
}

SignedDistance SolidElement::signed_distance(const Eigen::Vector3d& p_E,
                                             const ClosestPoint& closest, bool inside) const {
  SignedDistance result;
  if (!std::isfinite(closest.distance_sq)) return result;
  const double distance = std::sqrt(closest.distance_sq);
  result.witness = closest.point;
  result.distance = inside ? -distance : distance;
  if (distance > kTouchDistance) {
    result.normal = (inside ? closest.point - p_E : p_E - closest.point) / distance;
  } else {
    result.normal = normal_at_touch(bvh, normals[closest.triangle], closest.point);
  }
  return result;
}

SignedDistance to_link_frame(const SolidElement& element, const SignedDistance& in_E) {
  SignedDistance in_L;
  in_L.distance = in_E.distance;
  in_L.witness = element.X_LE * in_E.witness;
  in_L.normal = element.X_LE.linear() * in_E.normal;
  return in_L;
}

}  // namespace ist
