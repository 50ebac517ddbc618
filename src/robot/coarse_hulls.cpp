#include "internal/robot/coarse_hulls.h"

#include <algorithm>
#include <map>
#include <variant>

#include "internal/geometry/limits.h"
#include "internal/geometry/solid_queries.h"
#include "internal/geometry/tessellation.h"

namespace ist {
namespace {

// A hull need not hold all of its link: of the Panda's links, its capsules hold 51 to 100 %.
constexpr double kShareInside = 0.4;
// A hull and its link are of one size, while a mark of a frame, or a sensor in a base, is small.
constexpr double kSmallestRatio = 1.0 / 3.0;  // of diagonals
constexpr std::size_t kSamples = 2000;        // triangles of a mesh that are looked at
constexpr double kDeviation = 0.05;           // of those of a primitive, of its radius

// A link as it is drawn.
struct Drawing {
  const LinkDescription* link = nullptr;
  std::vector<std::string> above;  // links that fixed joints lead to it from, the nearest first
  Eigen::Isometry3d X_TL = Eigen::Isometry3d::Identity();   // T: the last of those, or itself
  std::vector<std::pair<Eigen::Vector3d, double>> samples;  // [m, m^2] in L, with their areas
  Eigen::AlignedBox3d box, box_T;                           // [m] in L, and in T
  std::size_t triangles = 0;                                // of meshes

  const std::string& top() const { return above.empty() ? link->name : above.back(); }
  bool is_below(const Drawing& other) const {
    return std::find(above.begin(), above.end(), other.link->name) != above.end();
  }
};

using JointOfChild = std::map<std::string, const JointDescription*>;

void add_element(const GeometryElement& element, Drawing* drawing) {
  const auto* given = std::get_if<TriangleMesh>(&element.shape);
  const TriangleMesh made = given == nullptr ? mesh_of(element.shape, kDeviation) : TriangleMesh();
  const TriangleMesh& mesh = given == nullptr ? made : *given;
  if (given != nullptr) drawing->triangles += mesh.triangles.size();
  const std::size_t step = 1 + mesh.triangles.size() / kSamples;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += step) {
    const Eigen::Vector3d &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    for (const auto* corner : {&a, &b, &c}) {
      const Eigen::Vector3d p_L = element.X_LE * *corner;
      drawing->box.extend(p_L);
      drawing->box_T.extend(drawing->X_TL * p_L);
    }
    const double area = 0.5 * static_cast<double>(step) * (b - a).cross(c - a).norm();
    drawing->samples.emplace_back(element.X_LE * Eigen::Vector3d((a + b + c) / 3.0), area);
  }
}

Drawing draw(const LinkDescription& link, const JointOfChild& joints) {
  Drawing drawing;
  drawing.link = &link;
  for (auto joint = joints.find(link.name);
       joint != joints.end() && joint->second->type == JointType::kFixed;
       joint = joints.find(joint->second->parent_link)) {
    drawing.above.push_back(joint->second->parent_link);
    drawing.X_TL = joint->second->X_PJ * drawing.X_TL;
  }
  for (const GeometryElement& element : link.geometry) add_element(element, &drawing);
  return drawing;
}

// The conditions that take no time to check.
bool may_enclose(const Drawing& hull, const Drawing& link) {
  return hull.triangles <= link.triangles && hull.box_T.intersects(link.box_T) &&
         hull.box.sizes().norm() > 0.0 &&
         link.box.sizes().norm() >= kSmallestRatio * hull.box.sizes().norm() &&
         hull.link != link.link && hull.top() == link.top() && !link.is_below(hull);
}

bool encloses(const Solid& hull, const Drawing& link, const Eigen::Isometry3d& X_HL) {
  double inside = 0.0, all = 0.0;
  for (const auto& [p_L, area] : link.samples) {
    all += area;
    if (hull.is_inside(X_HL * p_L)) inside += area;
  }
  return all > 0.0 && inside >= kShareInside * all;
}

bool is_drawn(const LinkDescription& link) {
  return link.error.empty() && !link.geometry.empty() &&
         std::all_of(link.geometry.begin(), link.geometry.end(),
                     [](const GeometryElement& one) { return element_fault(one).empty(); });
}

}  // namespace

std::vector<CoarseHull> coarse_hulls(const RobotDescription& robot,
                                     const CancelRequest& cancelled) {
  JointOfChild joints;
  for (const JointDescription& joint : robot.joints) joints[joint.child_link] = &joint;
  std::vector<Drawing> drawings;
  for (const LinkDescription& link : robot.links) {
    throw_if(cancelled);
    if (is_drawn(link)) drawings.push_back(draw(link, joints));
  }
  std::vector<CoarseHull> hulls;
  CancelWatch watch(cancelled);
  for (const Drawing& hull : drawings) {
    Solid solid;
    for (const Drawing& link : drawings) {
      watch.step();
      if (!may_enclose(hull, link)) continue;
      throw_if(cancelled);
      if (solid.empty()) solid = make_solid(hull.link->geometry, cancelled);
      if (!encloses(solid, link, hull.X_TL.inverse() * link.X_TL)) continue;
      hulls.push_back({hull.link->name, link.link->name, hull.is_below(link)});
    }
  }
  return hulls;
}

}  // namespace ist
