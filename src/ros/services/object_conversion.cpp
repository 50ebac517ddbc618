#include "ros/services/object_conversion.h"

#include <sstream>
#include <string>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_io.h"
#include "internal/robot/package_resolver.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/eigen_conversion.h"

namespace ist {
namespace {

using Request = ist_proximity::AttachObject::Request;

std::vector<double> sizes(const Request& request, std::size_t count, const char* what) {
  std::ostringstream text;
  if (request.dimensions.size() != count) {
    text << "dimensions holds " << request.dimensions.size() << " numbers; needed are " << count
         << ": " << what;
    throw ModelError(text.str());
  }
  for (const double size : request.dimensions) {
    if (size > 0.0 && size <= kMaxLength) continue;
    text << "dimensions holds " << size << " m; allowed is more than 0 and at most " << kMaxLength
         << " m (" << what << ")";
    throw ModelError(text.str());
  }
  return request.dimensions;
}

Shape to_shape(const Request& request, const PackageFinder& find_package,
               const CancelRequest& cancelled) {
  switch (request.shape) {
    case Request::BOX: {
      const std::vector<double> size = sizes(request, 3, "size along x, y, z");
      return Box{{size[0], size[1], size[2]}};
    }
    case Request::CYLINDER: {
      const std::vector<double> size = sizes(request, 2, "radius, length");
      return Cylinder{size[0], size[1]};
    }
    case Request::SPHERE:
      return Sphere{sizes(request, 1, "radius")[0]};
    case Request::MESH: {
      Eigen::Vector3d scale = Eigen::Vector3d::Ones();
      if (!request.dimensions.empty()) {
        if (request.dimensions.size() != 3) throw ModelError("dimensions: 3 scales are needed");
        scale << request.dimensions[0], request.dimensions[1], request.dimensions[2];
      }
      return load_mesh(resolve_uri(request.mesh, find_package), scale, cancelled);
    }
    default:
      throw ModelError("shape is " + std::to_string(request.shape) +
                       "; allowed is 0 (mesh), 1 (box), 2 (cylinder), 3 (sphere)");
  }
}

}  // namespace

AttachedObject to_object(const Request& request, const PackageFinder& find_package,
                         const CancelRequest& cancelled) {
  const std::string unnamed = name_fault(request.name);
  if (!unnamed.empty()) throw ModelError("name " + unnamed + "; the object needs one");
  AttachedObject object;
  object.name = request.name;
  object.link = request.link;
  geometry_msgs::Transform X_LE;
  assign(to_vector(request.pose.position), &X_LE.translation);
  X_LE.rotation = request.pose.orientation;
  const std::string fault = to_isometry(X_LE, &object.element.X_LE);
  if (!fault.empty()) throw ModelError("pose: " + fault);
  const std::string misplaced = position_fault("pose", object.element.X_LE.translation());
  if (!misplaced.empty()) throw ModelError(misplaced);
  object.element.shape = to_shape(request, find_package, cancelled);
  object.element.source = "attached object '" + request.name + "'";
  return object;
}

}  // namespace ist
