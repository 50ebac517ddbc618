#include "ist_proximity/proximity/known_world.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>
#include <variant>

#include "internal/bvh/build_id.h"
#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/packing/byte_stream.h"
#include "internal/packing/packing_cache.h"
#include "internal/robot/anytime_model.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "proximity/world_shape.h"

namespace ist {

/// The shapes of a world's objects by geometry_key(), so that objects of equal geometry share one,
/// and one that is sent again is not built again. It keeps no shape that nobody else has.
class ShapeCache {
 public:
  struct Entry {
    std::shared_ptr<const LinkGeometry> geometry;  ///< null: not known
    std::shared_ptr<const WorldShape> shape;
  };

  Entry find(const std::string& key) const {
    const auto found = entries_.find(key);
    if (found == entries_.end()) return {};
    Entry entry{found->second.geometry.lock(), found->second.shape.lock()};
    return entry.geometry && entry.shape ? entry : Entry();
  }
  void add(const std::string& key, const Entry& entry) {
    entries_[key] = {entry.geometry, entry.shape};
    if (entries_.size() < next_cleaning_) return;
    for (auto one = entries_.begin(); one != entries_.end();) {
      one = one->second.shape.expired() ? entries_.erase(one) : std::next(one);
    }
    next_cleaning_ = 2 * entries_.size() + 64;
  }

 private:
  struct Weak {
    std::weak_ptr<const LinkGeometry> geometry;
    std::weak_ptr<const WorldShape> shape;
  };
  std::map<std::string, Weak> entries_;
  std::size_t next_cleaning_ = 64;  // size
};

namespace {

// Spheres of an object's packing. It serves the bounds of depths alone; distances come from the
// exact geometry.
constexpr int kMaxSpheres = 32;
constexpr double kPackingError = 0.01;  // [m]

std::size_t triangles_of(const LinkGeometry& geometry) {
  std::size_t count = 0;
  for (const GeometryElement& element : geometry) {
    if (std::holds_alternative<Box>(element.shape)) count += 12;
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      count += mesh->triangles.size();
    }
  }
  return count;
}

std::string pose_fault(const Eigen::Isometry3d& X_BO) {
  if (!is_rigid(X_BO)) return "its pose is no rotation and translation of finite numbers";
  return position_fault("its position", X_BO.translation());
}

std::string object_fault(const WorldObject& object) {
  const std::string unnamed = name_fault(object.name);
  if (!unnamed.empty()) return "its name " + unnamed;
  const std::string unplaced = name_fault(object.frame);
  if (!unplaced.empty()) return "its frame " + unplaced;
  std::string misplaced = pose_fault(object.X_BO);
  if (!misplaced.empty()) return misplaced;
  if (!(object.margin >= 0.0 && object.margin <= kMaxLength)) {
    std::ostringstream text;
    text << "its margin is " << object.margin << " m; allowed is 0 to " << kMaxLength << " m";
    return text.str();
  }
  if (object.geometry.empty()) return "it has no shape";
  for (const GeometryElement& element : object.geometry) {
    std::string fault = element_fault(element);
    if (!fault.empty()) return fault;
  }
  return "";
}

std::string sentence(const std::string& name, const std::string& fault) {
  return "object '" + printable(name) + "': " + fault;
}

// The same for geometries that are the same, and else another one.
std::string geometry_key(const LinkGeometry& geometry) {
  ByteWriter key;
  for (const GeometryElement& element : geometry) {
    const std::string shape = packing_key(element.shape, {});
    key.u64(element.source.size());
    key.raw(element.source.data(), element.source.size());
    key.raw(shape.data(), shape.size());
    for (Eigen::Index i = 0; i < 16; ++i) key.f64(element.X_LE.matrix().data()[i]);
  }
  return key.bytes();
}

// An object to add, and its shape.
struct Taken {
  const WorldObject* object;
  std::string key;
  ShapeCache::Entry shape;  // without members: not known, or it cannot be built
  std::string fault = {};   // why it cannot
};

// Builds the shapes that are not known, each geometry once.
// @returns false when it was cancelled
bool build_missing(std::vector<Taken>* taken, ShapeCache* shapes,
                   const std::function<bool()>& cancelled) {
  std::map<std::string, std::vector<Taken*>> missing;  // by geometry
  for (Taken& one : *taken) {
    if (!one.shape.shape) missing[one.key].push_back(&one);
  }
  if (missing.empty()) return true;
  auto description = std::make_shared<RobotDescription>();
  for (const auto& [key, same] : missing) {
    LinkDescription link;
    link.name = "object " + std::to_string(description->links.size());
    link.geometry = same.front()->object->geometry;
    description->links.push_back(std::move(link));
  }
  RobotModelConfig config;
  config.packing.max_error = kPackingError;
  config.packing.max_spheres = kMaxSpheres;
  config.threads = 1;
  RobotModelCallbacks callbacks;
  callbacks.cancelled = cancelled;
  const auto built =
      AnytimeModel::build(description, config, AnytimeModel::Stage::kFirst, callbacks);
  if (!built) return false;
  std::size_t number = 0;
  for (const auto& [key, same] : missing) {
    LinkModel link = built->robot()->links[number++];
    ShapeCache::Entry entry;
    std::string fault;
    if (!link.usable() || link.tree.empty()) {
      fault = link.usable() ? "it has neither surface nor volume" : link.error;
    } else {
      entry.geometry = std::make_shared<const LinkGeometry>(same.front()->object->geometry);
      entry.shape = std::make_shared<const WorldShape>(std::move(link), cancelled);
      shapes->add(key, entry);
    }
    for (Taken* one : same) {
      one->shape = entry;
      one->fault = fault;
    }
  }
  return true;
}

}  // namespace

WorldBuilder::WorldBuilder(const WorldLimits& limits)
    : limits_(limits), shapes_by_geometry_(std::make_shared<ShapeCache>()) {}

std::string WorldBuilder::exceeded_limit(const std::vector<WorldObject>& objects) const {
  std::size_t triangles = triangles_, shapes = shapes_;
  std::set<std::string> names;
  std::size_t count = entries_.size();
  for (const WorldObject& object : objects) {
    triangles += triangles_of(object.geometry);
    shapes += object.geometry.size();
    if (!names.insert(object.name).second) continue;
    const auto known = entries_.find(object.name);
    if (known == entries_.end()) {
      ++count;
    } else {
      triangles -= known->second.triangles;
      shapes -= known->second.object.geometry->size();
    }
  }
  const auto text = [](std::size_t is, const char* what, std::size_t allowed, const char* limit) {
    return "the world would hold " + std::to_string(is) + " " + what + "; allowed are " +
           std::to_string(allowed) + " (" + limit + "): nothing of it is taken";
  };
  const std::size_t most = limits_.max_objects;
  if (count > most) return text(count, "objects", most, "max_objects");
  if (shapes > most) return text(shapes, "shapes", most, "max_objects");
  if (triangles > limits_.max_triangles) {
    return text(triangles, "triangles", limits_.max_triangles, "max_triangles");
  }
  return "";
}

std::vector<WorldFault> WorldBuilder::add(const std::vector<WorldObject>& objects,
                                          const std::function<bool()>& cancelled) {
  const std::string limit = exceeded_limit(objects);
  if (!limit.empty()) return {{"", limit}};
  std::vector<WorldFault> faults;
  std::vector<Taken> taken;
  for (const WorldObject& object : objects) {
    const std::string fault = object_fault(object);
    if (fault.empty()) {
      std::string key = geometry_key(object.geometry);
      const ShapeCache::Entry known = shapes_by_geometry_->find(key);
      taken.push_back({&object, std::move(key), known});
    } else {
      faults.push_back({object.name, sentence(object.name, fault)});
    }
  }
  try {
    if (!build_missing(&taken, shapes_by_geometry_.get(), cancelled)) return faults;
  } catch (const Cancelled&) {
    return faults;
  }
  for (const Taken& one : taken) {
    if (one.shape.shape) {
      insert(*one.object, one.shape.geometry, one.shape.shape);
    } else {
      faults.push_back({one.object->name, sentence(one.object->name, one.fault)});
    }
  }
  return faults;
}

void WorldBuilder::insert(const WorldObject& object,
                          const std::shared_ptr<const LinkGeometry>& geometry,
                          const std::shared_ptr<const WorldShape>& shape) {
  Entry entry;
  entry.object.name = object.name;
  entry.object.X_BO = object.X_BO;
  entry.object.margin = object.margin;
  entry.object.allowed_links = object.allowed_links;
  entry.object.geometry = geometry;
  entry.object.shape = shape;
  entry.object.id = next_build_id();
  entry.frame = object.frame;
  entry.triangles = triangles_of(object.geometry);
  remove(object.name);
  triangles_ += entry.triangles;
  shapes_ += object.geometry.size();
  entries_[object.name] = std::move(entry);
}

std::string WorldBuilder::move(const std::string& name, const std::string& frame,
                               const Eigen::Isometry3d& X_BO) {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return sentence(name, "it is to be moved, and was never added");
  std::string fault = name_fault(frame);
  if (!fault.empty()) return sentence(name, "its frame " + fault);
  fault = pose_fault(X_BO);
  if (!fault.empty()) return sentence(name, fault);
  found->second.frame = frame;
  found->second.object.X_BO = X_BO;
  return "";
}

bool WorldBuilder::remove(const std::string& name) {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return false;
  triangles_ -= found->second.triangles;
  shapes_ -= found->second.object.geometry->size();
  entries_.erase(found);
  return true;
}

void WorldBuilder::clear() {
  entries_.clear();
  triangles_ = shapes_ = 0;
}

std::shared_ptr<const KnownWorld> KnownWorld::in_frames(const std::vector<bool>& frames) const {
  auto world = std::make_shared<KnownWorld>(*this);
  const auto is_left_out = [&](const Object& object) { return !frames[object.frame]; };
  std::vector<Object>& objects = world->objects_;
  objects.erase(std::remove_if(objects.begin(), objects.end(), is_left_out), objects.end());
  return world;
}

std::shared_ptr<const KnownWorld> WorldBuilder::world() const {
  auto world = std::make_shared<KnownWorld>();
  world->objects_.reserve(entries_.size());
  std::map<std::string, std::size_t> frames;
  for (const auto& [name, entry] : entries_) {
    const auto [frame, is_new] = frames.try_emplace(entry.frame, frames.size());
    if (is_new) world->frames_.push_back(entry.frame);
    world->objects_.push_back(entry.object);
    world->objects_.back().frame = frame->second;
  }
  return world;
}

}  // namespace ist
