#include <algorithm>
#include <array>
#include <cmath>

#include "ist_proximity/tree/inner_sphere_tree.h"
#include "tree/partition.h"

namespace ist {
namespace {

constexpr std::size_t kMostPrototypes = static_cast<std::size_t>(kSphereWidth);
constexpr int kSteps = 20;
// The neighbourhood range lambda shrinks from half the prototypes to the nearest one alone, in
// effect.
constexpr double kLastRange = 0.01;
// Groups come out unequal: prototypes for full leaves would give many groups too large for one.
constexpr std::uint32_t kSpheresPerLeaf = 6;

using Prototypes = std::array<Eigen::Vector3d, kMostPrototypes>;
using Distances = std::array<double, kMostPrototypes>;

Distances distances_sq(const Prototypes& prototypes, std::size_t count, const Eigen::Vector3d& x) {
  Distances distances{};
  for (std::size_t k = 0; k < count; ++k) distances[k] = (prototypes[k] - x).squaredNorm();
  return distances;
}

// For each prototype, the number of prototypes that are nearer; among equals the first is nearer.
std::array<std::size_t, kMostPrototypes> ranks(const Distances& distances, std::size_t count) {
  std::array<std::size_t, kMostPrototypes> rank{};
  for (std::size_t k = 1; k < count; ++k) {
    for (std::size_t j = 0; j < k; ++j) {
      const bool j_first = distances[j] <= distances[k];
      rank[k] += j_first ? 1 : 0;
      rank[j] += j_first ? 0 : 1;
    }
  }
  return rank;
}

// A sphere is weighted by a power of the volume of its cover sphere, which is what nodes enclose.
double weight(const InnerSphere& sphere, double magnification) {
  if (magnification == 0.0) return 1.0;
  return std::max(std::pow(sphere.cover_radius, 3.0 * magnification), 1e-30);
}

// The prototypes start at the mean centres of groups split at medians: no random numbers.
Prototypes first_prototypes(const SphereRange& range, std::size_t count, SphereOrder* order,
                            std::size_t* found) {
  Prototypes prototypes;
  *found = 0;
  for (const SphereRange& part : split_at_medians(range, count, order)) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::uint32_t i = part.first; i < part.second; ++i) sum += (*order)[i].center;
    prototypes[(*found)++] = sum / static_cast<double>(size(part));
  }
  return prototypes;
}

// One batch step: each prototype moves to the weighted mean of all spheres. The weight of a sphere
// decays with the number of other prototypes that are nearer to it; `weights` are factors.
void move(const SphereRange& range, const SphereOrder& order, const std::vector<double>& weights,
          std::size_t count, double lambda, Prototypes* prototypes) {
  std::array<double, kMostPrototypes> share{}, total{};
  for (std::size_t k = 0; k < count; ++k) share[k] = std::exp(-static_cast<double>(k) / lambda);
  Prototypes sum;
  sum.fill(Eigen::Vector3d::Zero());
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const InnerSphere& sphere = order[i];
    const auto rank = ranks(distances_sq(*prototypes, count, sphere.center), count);
    const double v = weights[i - range.first];
    for (std::size_t k = 0; k < count; ++k) {
      const double w = share[rank[k]] * v;
      sum[k] += w * sphere.center;
      total[k] += w;
    }
  }
  for (std::size_t k = 0; k < count; ++k) {
    if (total[k] > 0.0) (*prototypes)[k] = sum[k] / total[k];
  }
}

}  // namespace

std::vector<SphereRange> split_by_neural_gas(const SphereRange& range, double magnification,
                                             SphereOrder* order) {
  const std::size_t wanted =
      std::min<std::size_t>(kMostPrototypes, (size(range) + kSpheresPerLeaf - 1) / kSpheresPerLeaf);
  std::size_t count = 0;
  Prototypes prototypes = first_prototypes(range, wanted, order, &count);
  std::vector<double> weights;
  weights.reserve(size(range));
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    weights.push_back(weight((*order)[i], magnification));
  }
  const double first_range = 0.5 * static_cast<double>(count);
  for (int step = 0; step < kSteps; ++step) {
    const double lambda = first_range * std::pow(kLastRange / first_range, step / (kSteps - 1.0));
    move(range, *order, weights, count, lambda, &prototypes);
  }
  std::vector<std::pair<std::size_t, std::uint32_t>> of_prototype;
  of_prototype.reserve(size(range));
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const auto rank = ranks(distances_sq(prototypes, count, (*order)[i].center), count);
    const auto nearest =
        std::find(rank.begin(), rank.begin() + static_cast<std::ptrdiff_t>(count), std::size_t{0});
    of_prototype.emplace_back(static_cast<std::size_t>(nearest - rank.begin()), order->indices[i]);
  }
  std::sort(of_prototype.begin(), of_prototype.end());
  std::vector<SphereRange> groups;
  for (std::uint32_t i = 0; i < of_prototype.size(); ++i) {
    const std::uint32_t at = range.first + i;
    order->indices[at] = of_prototype[i].second;
    if (i == 0 || of_prototype[i].first != of_prototype[i - 1].first) groups.emplace_back(at, at);
    groups.back().second = at + 1;
  }
  return groups;
}

}  // namespace ist
