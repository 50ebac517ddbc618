#include <algorithm>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/proximity/planning_scene.h"

namespace ist {
namespace {

constexpr std::size_t kMostNamed = 3;  // names in one sentence

// The name of the octomap among MoveIt's objects.
constexpr const char* kOctomapName = "<octomap>";

// [m, and of a rotation matrix] Poses that differ by less are the same: messages round.
constexpr double kSamePose = 1e-6;

const std::string& frame_of(const SceneObject& object, const std::string& default_frame) {
  return object.frame.empty() ? default_frame : object.frame;
}

bool is_same(const Eigen::Isometry3d& A, const Eigen::Isometry3d& B) {
  return (A.matrix() - B.matrix()).cwiseAbs().maxCoeff() <= kSamePose;
}

}  // namespace

std::vector<std::string> AllowedCollisions::allowed_with(
    const std::string& name, const std::function<bool(const std::string&)>& is_left_out) const {
  std::vector<std::string> found;
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end()) return found;
  const auto row = static_cast<std::size_t>(at - names.begin());
  for (std::size_t i = 0; i < names.size(); ++i) {
    // The pair is measured if the matrix is not symmetric.
    if (i == row || !is_allowed[row][i] || !is_allowed[i][row]) continue;
    if (!is_left_out(names[i])) found.push_back(names[i]);
  }
  return found;
}

bool removes_octomap(const PlanningScene& scene) {
  return std::any_of(scene.objects.begin(), scene.objects.end(), [](const SceneObject& object) {
    return object.id == kOctomapName && object.operation == SceneObject::Operation::kRemove;
  });
}

bool AttachedObjects::attach(const SceneAttachment& attachment) {
  const std::string& id = attachment.object.id;
  if (attached_.size() >= most_ && !contains(id)) return false;
  attached_[id] = {attachment.link, attachment.touch_links};
  return true;
}

std::vector<std::string> AttachedObjects::detach(const SceneAttachment& attachment) {
  const std::string &id = attachment.object.id, &link = attachment.link;
  std::vector<std::string> names;
  for (auto known = attached_.begin(); known != attached_.end();) {
    const bool is_meant =
        (id.empty() || known->first == id) && (link.empty() || known->second.link == link);
    if (is_meant) names.push_back(known->first);
    known = is_meant ? attached_.erase(known) : std::next(known);
  }
  return names;
}

std::vector<std::string> AttachedObjects::names() const {
  std::vector<std::string> names;
  names.reserve(attached_.size());
  for (const auto& known : attached_) names.push_back(known.first);
  return names;
}

std::vector<std::string> AttachedObjects::touched_by(const std::string& id) const {
  const auto known = attached_.find(id);
  if (known == attached_.end()) return {};
  std::vector<std::string> links = known->second.touch_links;
  links.push_back(known->second.link);
  return links;
}

std::string AttachedObjects::sentence() const {
  if (attached_.empty()) return "";
  std::string names;
  std::size_t named = 0;
  for (const auto& [id, attached] : attached_) {
    if (named++ == kMostNamed) break;
    names +=
        (names.empty() ? "'" : ", '") + printable(id) + "' (to '" + printable(attached.link) + "')";
  }
  if (attached_.size() > kMostNamed)
    names += " and " + std::to_string(attached_.size() - kMostNamed) + " more";
  return "attached to the robot are " + names +
         ": measured against the robot's other links alone, not against clouds, the octomap and "
         "other objects (~attach_object does that)";
}

WorldObject to_world_object(const SceneObject& object, const std::string& default_frame) {
  WorldObject result;
  result.name = object.id;
  result.frame = frame_of(object, default_frame);
  result.X_BO = object.X_BP;
  result.geometry = object.geometry;
  if (object.has_pose || object.geometry.size() != 1) return result;
  // The shape's frame becomes the object's.
  result.X_BO = object.X_PS[0];
  GeometryElement& element = result.geometry[0];
  element.X_LE = object.X_PS[0].inverse() * element.X_LE;
  return result;
}

std::string append_shapes(const SceneObject& object, const std::string& default_frame,
                          WorldObject* known) {
  const WorldObject added = to_world_object(object, default_frame);
  if (known->frame != added.frame) {
    return "shapes are to be appended in frame '" + printable(added.frame) +
           "', and it stands in '" + printable(known->frame) + "': send all of it with ADD";
  }
  // MoveIt reads such poses relative to the known object, their definition relative to the frame.
  if (object.layout == SceneLayout::kObjectPose && !is_same(known->X_BO, added.X_BO)) {
    return "shapes are to be appended at another pose than the object's: send all of it with ADD";
  }
  const Eigen::Isometry3d X_OA = known->X_BO.inverse() * added.X_BO;
  for (GeometryElement element : added.geometry) {
    element.X_LE = X_OA * element.X_LE;
    known->geometry.push_back(std::move(element));
  }
  return "";
}

std::string moved_pose(const SceneObject& object, const WorldObject& known,
                       Eigen::Isometry3d* X_BO) {
  if (object.X_PS.empty()) {
    if (object.layout == SceneLayout::kShapePoses)
      return "it is to be moved, and no pose is stated";
    *X_BO = object.X_BP;
    return "";
  }
  const std::string advice = ": send all of it with ADD";
  const LinkGeometry& geometry = known.geometry;
  if (object.X_PS.size() != geometry.size()) {
    return "it is to be moved with " + std::to_string(object.X_PS.size()) + " poses, and it has " +
           std::to_string(geometry.size()) + " shapes" + advice;
  }
  const Eigen::Isometry3d X = object.X_BP * object.X_PS[0] * geometry[0].X_LE.inverse();
  for (std::size_t i = 0; i < geometry.size(); ++i) {
    // The pose of a plane's box is not that of the plane.
    if (geometry[i].source == "plane") return "it has a plane and is to be moved" + advice;
    if (!is_same(X * geometry[i].X_LE, object.X_BP * object.X_PS[i])) {
      return "its shapes are to be moved against one another" + advice;
    }
  }
  *X_BO = X;
  return "";
}

}  // namespace ist
