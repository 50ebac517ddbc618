#include "internal/robot/model_memory.h"

#include "internal/geometry/distance_field.h"
#include "internal/geometry/solid_queries.h"

namespace ist {

ModelMemory memory_of(const RobotModel& model) {
  ModelMemory memory;
  for (const LinkModel& link : model.links) {
    memory.packings += link.packing.spheres.capacity() * sizeof(InnerSphere);
    memory.trees += link.tree.nodes().capacity() * sizeof(SphereNode) +
                    link.tree.leaves().capacity() * sizeof(SphereLeaf);
    memory.solids += memory_of(link.solid);
    if (link.field != nullptr) memory.fields += link.field->memory();
  }
  return memory;
}

}  // namespace ist
