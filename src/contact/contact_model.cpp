#include "ist_proximity/contact/contact_model.h"

#include <chrono>
#include <optional>
#include <sstream>
#include <utility>

#include "contact/contact_spheres.h"
#include "internal/packing/packer.h"
#include "internal/packing/packing_cache.h"
#include "internal/robot/link_packing.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

enum class Outcome { kDone, kLate, kCancelled };

/// One element's packing, from the cache or made.
Outcome pack(const Shape& shape, const PackingConfig& config, double time_limit,
             const PackingCache& cache, const std::function<bool()>& cancelled, bool* from_cache,
             Packing* packing) {
  const std::string key = packing_key(shape, config);
  std::string warning;
  auto start = Clock::now();
  bool is_cancelled = false, is_late = false;
  const PackingProgress goes_on = [&](double) {
    is_cancelled = is_cancelled || (cancelled && cancelled());
    is_late = is_late || seconds_since(start) > time_limit;
    return !is_cancelled && !is_late;
  };
  if (std::optional<Packing> cached = cache.load(key, shape, config, goes_on, &warning)) {
    *packing = std::move(*cached);
    return Outcome::kDone;
  }
  if (is_cancelled) return Outcome::kCancelled;
  *from_cache = false;
  start = Clock::now();
  is_late = false;
  *packing = pack_element(shape, config, goes_on);
  if (is_cancelled) return Outcome::kCancelled;
  // How far it got depends on the machine, so the cache does not keep it.
  if (is_late) return Outcome::kLate;
  cache.store(key, *packing, &warning);
  return Outcome::kDone;
}

/// The packing of all elements.
Outcome pack_link(const LinkGeometry& geometry, std::size_t attached, const ContactConfig& config,
                  const PackingCache& cache, const std::function<bool()>& cancelled,
                  bool* from_cache, Packing* packing) {
  const std::vector<PackingConfig> configs = link_configs(geometry, attached, config.packing);
  std::vector<Packing> packings(geometry.size());
  std::vector<const Packing*> pointers;
  for (std::size_t e = 0; e < geometry.size(); ++e) {
    const Outcome outcome = pack(geometry[e].shape, configs[e], config.time_limit, cache, cancelled,
                                 from_cache, &packings[e]);
    if (outcome != Outcome::kDone) return outcome;
    pointers.push_back(&packings[e]);
  }
  *packing = combine(geometry, pointers);
  return Outcome::kDone;
}

}  // namespace

const ContactGeometry* find_contact_geometry(const ContactModel* contacts, const RobotModel& robot,
                                             std::size_t link) {
  if (contacts == nullptr || !contacts->robot || !same_geometry(*contacts->robot, robot)) {
    return nullptr;
  }
  const ContactGeometry* geometry = contacts->links[link].get();
  return geometry != nullptr && geometry->has_volume() ? geometry : nullptr;
}

std::string contact_geometry_key(const LinkGeometry& geometry, std::size_t attached,
                                 const ContactConfig& config) {
  const std::vector<PackingConfig> configs = link_configs(geometry, attached, config.packing);
  std::ostringstream key;
  key.precision(17);
  for (std::size_t e = 0; e < geometry.size(); ++e) {
    key << packing_key(geometry[e].shape, configs[e]);
    key << '\n' << geometry[e].X_LE.matrix() << '\n';
  }
  return key.str();
}

std::shared_ptr<const ContactGeometry> build_contact_geometry(
    const LinkGeometry& geometry, std::size_t attached, const LinkModel& link,
    const ContactConfig& config, const std::string& cache_directory,
    const std::function<bool()>& cancelled) {
  const auto start = Clock::now();
  Packing packing;
  bool from_cache = true;
  const Outcome outcome = pack_link(geometry, attached, config, PackingCache(cache_directory),
                                    cancelled, &from_cache, &packing);
  if (outcome == Outcome::kCancelled) return nullptr;
  const bool is_late = outcome == Outcome::kLate;
  if (is_late) {
    packing = disjoint_part(link.packing, static_cast<std::size_t>(config.packing.max_spheres));
  }
  auto result =
      std::make_shared<ContactGeometry>(make_contact_geometry(geometry, link.solid, packing));
  if (is_late && result->note.empty()) {
    std::ostringstream text;
    text << "packing its volume was broken off after " << config.time_limit
         << " s; a disjoint part of its packing for distances, coarser, takes its place";
    result->note = text.str();
  }
  result->from_cache = from_cache;
  result->time = seconds_since(start);
  return result;
}

}  // namespace ist
