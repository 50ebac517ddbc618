// MoveIt scenes: what is read keeps to the limits, and each object of it is in the world or there
// is a fault that names it.
// Covers: src/proximity/world_file.cpp src/proximity/known_world.cpp

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/proximity/world_file.h"
#include "support/check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ist::WorldLimits limits;
  limits.max_objects = 20;
  limits.max_triangles = 400;  // a cone has 256
  const std::string text(reinterpret_cast<const char*>(data), size);
  const ist::SceneFile scene = ist::parse_scene(text, "world", limits);
  FUZZ_CHECK(scene.fault.empty() || scene.objects.empty(), "a fault, and objects: %s",
             scene.fault.c_str());
  FUZZ_CHECK(scene.objects.size() <= limits.max_objects, "%zu objects", scene.objects.size());
  std::set<std::string> names;
  for (const ist::WorldObject& object : scene.objects) {
    FUZZ_CHECK(names.insert(object.name).second, "two objects '%s'", object.name.c_str());
  }
  ist::WorldBuilder builder(limits);
  const std::vector<ist::WorldFault> faults = builder.add(scene.objects);
  const bool is_refused = faults.size() == 1 && faults[0].object.empty();
  if (is_refused) {
    FUZZ_CHECK(builder.size() == 0, "refused as a whole, and %zu are there", builder.size());
    return 0;
  }
  for (const ist::WorldObject& object : scene.objects) {
    const auto fault = std::find_if(faults.begin(), faults.end(), [&](const ist::WorldFault& f) {
      return f.object == object.name;
    });
    FUZZ_CHECK((fault == faults.end()) == builder.contains(object.name),
               "'%s' is neither there nor named, or both", object.name.c_str());
  }
  const auto world = builder.world();
  std::size_t triangles = 0;
  for (const ist::KnownWorld::Object& object : world->objects()) {
    for (const ist::GeometryElement& element : *object.geometry) {
      const auto* mesh = std::get_if<ist::TriangleMesh>(&element.shape);
      if (mesh != nullptr) triangles += mesh->triangles.size();
    }
  }
  FUZZ_CHECK(triangles <= limits.max_triangles, "%zu triangles", triangles);
  return 0;
}
