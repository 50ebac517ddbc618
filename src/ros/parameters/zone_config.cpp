#include "ros/parameters/zone_config.h"

#include <set>
#include <variant>

#include "internal/geometry/limits.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_table.h"

namespace ist {
namespace {

// [m] Of a zone along each axis: with a larger one nothing near the robot would be an obstacle.
constexpr double kMostSize = 10.0;
constexpr double kLongestLifetime = 1e6;  // [s]

std::string zone_fault(const ZoneConfig& zone) {
  std::string fault = name_fault(zone.name);
  if (!fault.empty()) return "its name " + fault;
  fault = name_fault(zone.frame);
  if (!fault.empty()) return "its frame " + fault;
  const std::vector<double> sizes = zone_sizes(zone.shape);
  if (sizes.empty()) return "its shape is no box, cylinder or sphere";
  for (const double size : sizes) {
    if (size > 0.0 && size <= kMostSize) continue;
    return format_text("it measures %g m; allowed is more than 0 and at most %g m along each axis",
                       size, kMostSize);
  }
  fault = position_fault("its pose", zone.X_BZ.translation());
  if (!fault.empty()) return fault;
  if (!(zone.lifetime >= 0.0 && zone.lifetime <= kLongestLifetime)) {
    return format_text("its lifetime is %g s; allowed is 0 (until it is removed) to %g s",
                       zone.lifetime, kLongestLifetime);
  }
  return "";
}

}  // namespace

std::vector<double> zone_sizes(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    return {box->size.x(), box->size.y(), box->size.z()};
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return {2.0 * sphere->radius};
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return {2.0 * cylinder->radius, cylinder->length};
  }
  return {};
}

std::string zones_fault(const std::vector<ZoneConfig>& zones) {
  std::set<std::set<std::string>> sets;
  for (std::size_t i = 0; i < zones.size(); ++i) {
    const std::string zone = "zone '" + printable(zones[i].name) + "' ";
    const std::string fault = zone_fault(zones[i]);
    if (!fault.empty()) return zone + "cannot be used: " + fault;
    if (i >= kMostZones) {
      return zone + "is one too many: allowed are " + std::to_string(kMostZones);
    }
    if (!zones[i].links.empty()) sets.insert({zones[i].links.begin(), zones[i].links.end()});
    if (sets.size() > kMostLinkSets) {
      return zone + "names another set of links than " + std::to_string(kMostLinkSets) +
             " others do; allowed are so many sets";
    }
  }
  return "";
}

std::vector<ZoneConfig> read_zones(ParameterReader* reader) {
  std::vector<ZoneConfig> zones;
  if (!reader->has("zones")) return zones;
  for (const std::string& name : reader->children("zones")) {
    const std::string at = "zones/" + name + "/";
    WorldObjectConfig object;
    read_object(reader, at, false, &object);
    ZoneConfig zone;
    zone.name = name;
    reader->read_all(
        {{at + "links", &zone.links},
         {at + "lifetime", &zone.lifetime, Range::non_negative("s", kLongestLifetime)}});
    zone.frame = object.object.frame;
    zone.X_BZ = object.object.X_BO;
    if (object.object.geometry.empty()) {  // which has been told, but for a mesh
      if (!object.mesh.empty())
        reader->add_error(at + "shape", "is mesh: allowed is box, cylinder, sphere");
      continue;
    }
    zone.shape = object.object.geometry.front().shape;
    zones.push_back(std::move(zone));
  }
  const std::string fault = zones_fault(zones);
  if (!fault.empty()) reader->add_error("zones", ": " + fault);
  return zones;
}

}  // namespace ist
