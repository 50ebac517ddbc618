#include "ros/services/object_conversion.h"

#include <string>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/input/world_conversion.h"

namespace ist {

AttachedObject to_object(const ist_proximity::AttachObject::Request& request,
                         const PackageFinder& find_package, const CancelRequest& cancelled) {
  const std::string unnamed = name_fault(request.name);
  if (!unnamed.empty()) throw ModelError("name " + unnamed + "; the object needs one");
  if (request.shape > request.SPHERE) {
    throw ModelError("shape is " + std::to_string(request.shape) +
                     "; allowed is 0 (mesh), 1 (box), 2 (cylinder), 3 (sphere)");
  }
  if (request.shape == request.MESH && request.mesh.empty()) throw ModelError("mesh is empty");
  ist_proximity::WorldObject described;  // its numbers of shapes and its dimensions are the same
  described.shape = request.shape;
  described.dimensions = request.dimensions;
  described.mesh = request.mesh;
  AttachedObject object;
  object.name = request.name;
  object.link = request.link;
  const Eigen::Isometry3d X_LE = to_object_pose(request.pose);
  const std::string misplaced = position_fault("pose", X_LE.translation());
  if (!misplaced.empty()) throw ModelError(misplaced);
  object.element = to_element(described, find_package, cancelled);
  object.element.X_LE = X_LE;
  object.element.source = "attached object '" + request.name + "'";
  return object;
}

}  // namespace ist
