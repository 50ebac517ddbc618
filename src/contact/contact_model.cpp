#include "ist_proximity/contact/contact_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>

#include "internal/packing/packer.h"
#include "internal/packing/packing_cache.h"
#include "internal/robot/link_packing.h"
#include "volume_share.h"
#include "way_out.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;

// Smaller spheres than this share of the largest one hold next to nothing.
constexpr double kSmallest = 1e-3;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The spheres that have a volume, without their gaps, which would loosen the tree.
Packing solid_spheres(const Packing& packing) {
  double largest = 0.0;
  for (const InnerSphere& sphere : packing.spheres) largest = std::max(largest, sphere.radius);
  Packing tight;
  for (const InnerSphere& sphere : packing.spheres) {
    if (sphere.radius > kSmallest * largest) {
      tight.spheres.push_back({sphere.center, sphere.radius, sphere.radius});
    }
  }
  return tight;
}

/// Holds the surface, where the packing covers it.
Eigen::AlignedBox3d covered_box(const Packing& packing) {
  Eigen::AlignedBox3d box;
  for (const InnerSphere& sphere : packing.spheres) {
    box.extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
    box.extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
  }
  return box;
}

ContactLeaf make_leaf(const SphereLeaf& leaf) {
  ContactLeaf result{};
  for (int k = 0; k < kSphereWidth; ++k) {
    result.x[k] = leaf.x[k];
    result.y[k] = leaf.y[k];
    result.z[k] = leaf.z[k];
    result.radius[k] = k < leaf.count ? leaf.inner_radius[k] : -1.0F;
  }
  return result;
}

/// The sphere that a slot of the tree's leaves holds: the tree sorts them anew.
std::size_t find_sphere(const std::vector<InnerSphere>& spheres, const Eigen::Vector3f& center) {
  std::size_t best = 0;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double squared = (spheres[i].center - center.cast<double>()).squaredNorm();
    if (squared >= nearest) continue;
    nearest = squared;
    best = i;
  }
  return best;
}

enum class Outcome { kDone, kLate, kCancelled };

/// One element's packing, from the cache or made.
Outcome pack(const Shape& shape, const PackingConfig& config, double time_limit,
             const PackingCache& cache, const std::function<bool()>& cancelled, bool* from_cache,
             Packing* packing) {
  const std::string key = packing_key(shape, config);
  std::string warning;
  if (std::optional<Packing> cached = cache.load(key, &warning)) {
    *packing = std::move(*cached);
    return Outcome::kDone;
  }
  *from_cache = false;
  const auto start = Clock::now();
  bool is_cancelled = false, is_late = false;
  *packing = pack_element(shape, config, [&](double) {
    is_cancelled = is_cancelled || (cancelled && cancelled());
    is_late = is_late || seconds_since(start) > time_limit;
    return !is_cancelled && !is_late;
  });
  if (is_cancelled) return Outcome::kCancelled;
  // How far it got is the machine's matter: not for the cache.
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

const ContactBody* find_body(const ContactModel* contacts, const RobotModel& robot,
                             std::size_t link) {
  if (contacts == nullptr || contacts->robot.get() != &robot) return nullptr;
  const ContactBody* body = contacts->bodies[link].get();
  return body != nullptr && body->has_volume() ? body : nullptr;
}

ContactBody make_contact_body(const LinkGeometry& geometry, const Solid& solid,
                              const Packing& packing) {
  ContactBody body;
  const Packing tight = solid_spheres(packing);
  if (tight.spheres.empty()) {
    body.note = "has no volume (sheets): no penetration wrench";
    return body;
  }
  body.tree = InnerSphereTree(tight);
  body.sphere_count = tight.spheres.size();
  const VolumeShares shares = volume_shares(tight.spheres, covered_box(packing), solid);
  body.volume = shares.volume;
  body.packed_volume = shares.packed_volume;
  const WayOut way_out(geometry, solid);
  for (const SphereLeaf& source : body.tree.leaves()) {
    ContactLeaf leaf = make_leaf(source);
    for (int k = 0; k < source.count; ++k) {
      const InnerSphere& sphere =
          tight.spheres[find_sphere(tight.spheres, {source.x[k], source.y[k], source.z[k]})];
      leaf.share[k] = static_cast<float>(
          shares.share[static_cast<std::size_t>(&sphere - tight.spheres.data())]);
      const Eigen::Vector3f out = way_out(sphere.center).cast<float>();
      const Eigen::Matrix3f slope = way_out.slope(sphere.center, sphere.radius).cast<float>();
      for (int row = 0; row < 3; ++row) {
        leaf.out[row][k] = out[row];
        for (int column = 0; column < 3; ++column) {
          leaf.slope[3 * row + column][k] = slope(row, column);
        }
      }
    }
    body.leaves.push_back(leaf);
  }
  return body;
}

std::string contact_body_key(const LinkGeometry& geometry, std::size_t attached,
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

Packing disjoint_part(const Packing& packing, std::size_t count) {
  std::vector<InnerSphere> spheres = packing.spheres;
  std::stable_sort(spheres.begin(), spheres.end(),
                   [](const InnerSphere& a, const InnerSphere& b) { return a.radius > b.radius; });
  Packing part;
  for (const InnerSphere& sphere : spheres) {
    if (part.spheres.size() == count || !(sphere.radius > 0.0)) break;
    const bool fits =
        std::all_of(part.spheres.begin(), part.spheres.end(), [&](const InnerSphere& other) {
          return (sphere.center - other.center).norm() >= sphere.radius + other.radius;
        });
    if (fits) part.spheres.push_back(sphere);
  }
  return part;
}

std::shared_ptr<const ContactBody> build_contact_body(const LinkGeometry& geometry,
                                                      std::size_t attached, const LinkModel& link,
                                                      const ContactConfig& config,
                                                      const std::string& cache_directory,
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
  auto body = std::make_shared<ContactBody>(make_contact_body(geometry, link.solid, packing));
  if (is_late && body->note.empty()) {
    std::ostringstream text;
    text << "packing its volume was broken off after " << config.time_limit
         << " s; a disjoint part of its packing for distances, coarser, takes its place";
    body->note = text.str();
  }
  body->from_cache = from_cache;
  body->time = seconds_since(start);
  return body;
}

}  // namespace ist
