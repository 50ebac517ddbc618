#pragma once

#include <ist_proximity/AttachObject.h>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Makes the object that a request describes, and reads its mesh.
/// @throws ModelError naming the field that is wrong, its value and what is allowed
/// @throws Cancelled
AttachedObject to_object(const ist_proximity::AttachObject::Request& request,
                         const PackageFinder& find_package, const CancelRequest& cancelled);

}  // namespace ist
