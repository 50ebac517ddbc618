#include "proximity/planning_scene_fields.h"

#include <cmath>

#include "ist_proximity/proximity/world_file.h"

namespace ist {
namespace {

constexpr double kLengthTolerance = 1e-2;  // of quaternions, as in files of scenes

}  // namespace

void note(std::string* fault, const std::string& text) {
  if (fault->empty()) *fault = text;
}

Eigen::Isometry3d read_pose(WireReader* in, const char* what, std::string* fault) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  double v[7];
  for (double& value : v) value = in->f64(what);
  const Eigen::Vector3d p(v[0], v[1], v[2]);
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const double length = q.norm();
  const bool is_unit = std::abs(length - 1.0) <= kLengthTolerance;
  if (length != 0.0 && !is_unit) {
    note(fault, std::string(what) + " has a quaternion of length " + std::to_string(length));
  } else {
    note(fault, position_fault(what, p));
    X.translation() = p;
    if (is_unit) X.linear() = q.normalized().toRotationMatrix();
  }
  return X;
}

std::string read_header_frame(WireReader* in) {
  in->skip(12, "a header");
  return in->string(kNameBuffer, "a frame's name");
}

bool read_scene_octomap(WireReader* in, const OctreeLimits& limits, SceneOctomap* octomap) {
  octomap->frame = read_header_frame(in);
  octomap->X_BM = read_pose(in, "its origin", &octomap->fault);
  read_header_frame(in);  // MoveIt does not use it
  OctreeData data;
  data.is_binary = in->boolean("the octomap");
  data.id = in->string(kNameBuffer, "the octomap's type");
  data.resolution = in->f64("the octomap's resolution");
  data.size = in->count(1, "bytes of the octomap");
  data.data = in->take(data.size, "bytes of the octomap");
  if (data.size == 0) {
    octomap->fault.clear();  // there is nothing that could stand anywhere
    return !data.id.empty();
  }
  // MoveIt leaves the origin aside then, and the definition of the message does not.
  if (octomap->frame.empty() && !octomap->X_BM.matrix().isIdentity(0.0)) {
    note(&octomap->fault, "it has an origin and no frame_id");
  }
  if (octomap->frame.size() > kMaxNameSize) {
    note(&octomap->fault,
         "its frame_id has more than " + std::to_string(kMaxNameSize) + " characters");
  }
  if (octomap->fault.empty()) octomap->fault = read_octree(data, &octomap->tree, limits);
  if (!octomap->fault.empty()) octomap->tree = Octree();
  return true;
}

}  // namespace ist
