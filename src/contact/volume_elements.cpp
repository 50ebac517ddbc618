#include "contact/volume_elements.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// Cells of the grid over the link's box. A cell is divided in kParts^3 where the surface cuts it.
constexpr double kCells = 4000.0;
constexpr int kParts = 3;
// Cells along each side of a block.
constexpr int kBlock = 4;
// An outward field shorter than this has no direction any more: it shortens to 0 and does not turn.
constexpr double kUndecided = 0.2;
// Exact distances that are measured between two looks at the clock.
constexpr std::uint32_t kDistancesBetweenLooks = 4;
// Blocks that are kept for later, at most; a link that is not far longer than wide has fewer.
constexpr std::size_t kPostponed = 512;

Eigen::AlignedBox3d box_of(const Solid& solid) {
  Eigen::AlignedBox3d box;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d n = Eigen::Vector3d::Unit(axis);
    box.max()[axis] = support(solid, n);
    box.min()[axis] = -support(solid, -n);
  }
  return box;
}

// Sums over parts of a cell.
struct Mass {
  double volume = 0.0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();

  void add(const Eigen::Vector3d& p, const Eigen::Vector3d& size, double weight) {
    volume += weight;
    first += weight * p;
    second += weight * p * p.transpose();
    second.diagonal() += weight / 12.0 * size.cwiseAbs2();
  }
};

// The part of a cell behind the solid's surface.
Mass mass_of(const Solid& solid, const Eigen::Vector3d& center, const Eigen::Vector3d& size) {
  Mass mass;
  const double distance = solid.signed_distance(center).distance;
  if (distance >= 0.5 * size.norm()) return mass;
  if (distance <= -0.5 * size.norm()) {
    mass.add(center, size, size.prod());
    return mass;
  }
  const Eigen::Vector3d part = size / kParts;
  for (int i = 0; i < kParts * kParts * kParts; ++i) {
    const Eigen::Array3i at(i % kParts, i / kParts % kParts, i / kParts / kParts);
    const Eigen::Array3d from_middle = at.cast<double>() + 0.5 - 0.5 * kParts;
    const Eigen::Vector3d p = center + (from_middle * part.array()).matrix();
    const SignedDistance found = solid.signed_distance(p);
    const double width = found.normal.cwiseAbs().dot(part);
    const double share = width > 0.0 ? std::clamp(0.5 - found.distance / width, 0.0, 1.0) : 0.0;
    if (!(share > 0.0)) continue;
    // The part that is cut off lies outward.
    const Eigen::Vector3d inner = p - 0.5 * (1.0 - share) * width * found.normal;
    mass.add(inner, part * std::cbrt(share), share * part.prod());
  }
  return mass;
}

}  // namespace

VolumeElements::VolumeElements(const Solid& solid, const OutwardField& field) {
  const Eigen::AlignedBox3d box = box_ = box_of(solid);
  const double step = std::cbrt(box.volume() / kCells);
  if (!(step > 0.0)) return;
  const Eigen::Array3i counts = (box.sizes().array() / step).ceil().max(1.0).cast<int>();
  const Eigen::Vector3d size = box.sizes().array() / counts.cast<double>();
  const Eigen::Array3i blocks = (counts + kBlock - 1) / kBlock;
  for (int b = 0; b < blocks.prod(); ++b) {
    const Eigen::Array3i corner =
        kBlock *
        Eigen::Array3i(b % blocks.x(), b / blocks.x() % blocks.y(), b / blocks.x() / blocks.y());
    Block block;
    block.first = elements_.size();
    for (int i = 0; i < kBlock * kBlock * kBlock; ++i) {
      const Eigen::Array3i cell =
          corner + Eigen::Array3i(i % kBlock, i / kBlock % kBlock, i / kBlock / kBlock);
      if ((cell >= counts).any()) continue;
      const Eigen::Vector3d center =
          box.min() + ((cell.cast<double>() + 0.5) * size.array()).matrix();
      const Mass mass = mass_of(solid, center, size);
      if (!(mass.volume > 1e-6 * size.prod())) continue;
      const Eigen::Vector3d mean = mass.first / mass.volume;
      const Eigen::Vector3d o = field.at(mean);
      VolumeElement element;
      element.center = mean.cast<float>();
      element.volume = static_cast<float>(mass.volume);
      block.volume += static_cast<double>(element.volume);
      element.covariance = (mass.second / mass.volume - mean * mean.transpose()).cast<float>();
      element.outward = (o / std::sqrt(o.squaredNorm() + kUndecided * kUndecided)).cast<float>();
      elements_.push_back(element);
      block.center += mean;
    }
    block.last = elements_.size();
    if (block.last == block.first) continue;
    block.center /= static_cast<double>(block.last - block.first);
    for (std::size_t i = block.first; i < block.last; ++i) {
      block.radius =
          std::max(block.radius, (elements_[i].center.cast<double>() - block.center).norm());
    }
    block.radius += size.norm();
    blocks_.push_back(block);
  }
  elements_.shrink_to_fit();
}

// [m^3] Of the blocks from this one on that are near a solid.
double VolumeElements::volume_near(std::size_t first, const Eigen::AlignedBox3d& solid_box,
                                   const Eigen::Isometry3d& X_SL) const {
  double volume = 0.0;
  for (std::size_t i = first; i < blocks_.size(); ++i) {
    if (is_near(blocks_[i], solid_box, X_SL)) volume += blocks_[i].volume;
  }
  return volume;
}

// [m] How deep a block's middle is inside; -inf where no point of the block can be.
double VolumeElements::depth_of(const Block& block, const Solid& solid,
                                const Eigen::AlignedBox3d& solid_box,
                                const Eigen::Isometry3d& X_SL) {
  if (!is_near(block, solid_box, X_SL)) return -kInfinity;
  // In a mesh with holes the signed distance jumps where its inside ends without a surface.
  return solid.is_closed() ? -solid.signed_distance(X_SL * block.center).distance : 0.0;
}

// Blocks that are wholly inside hold the most and cost the least: they are summed first.
ContactVolume VolumeElements::inside(const Solid& solid, const Eigen::AlignedBox3d& solid_box,
                                     const Eigen::Isometry3d& X_SL, Deadline* deadline,
                                     double* rest) const {
  ContactVolume sum;
  std::array<std::uint32_t, kPostponed> cut;  // blocks that the solid's surface may cut
  std::size_t cuts = 0, done = 0, done_cuts = 0;
  double in_block = 0.0;  // of the block that is being summed: the volume not yet looked at
  const auto add_block = [&](const Block& block, const Solid* cutting) {
    in_block = block.volume;
    for (std::size_t i = block.first; i < block.last; ++i) {
      if (deadline->passed_now_and_then(kDistancesBetweenLooks)) return false;
      add(elements_[i], cutting, X_SL, &sum);
      in_block -= static_cast<double>(elements_[i].volume);
    }
    in_block = 0.0;
    return true;
  };
  for (; done < blocks_.size() && !deadline->passed_now_and_then(kDistancesBetweenLooks); ++done) {
    const Block& block = blocks_[done];
    const double depth = depth_of(block, solid, solid_box, X_SL);
    if (-depth >= block.radius) continue;
    if (depth >= block.radius) {
      if (!add_block(block, nullptr)) break;
    } else if (cuts < cut.size()) {
      cut[cuts++] = static_cast<std::uint32_t>(done);
    } else if (!add_block(block, &solid)) {
      break;
    }
  }
  while (done_cuts < cuts && !deadline->has_passed()) {
    done_cuts += add_block(blocks_[cut[done_cuts]], &solid) ? 1 : 0;
  }
  // A block in which time ended is counted by its elements that are left.
  *rest = in_block;
  const std::size_t begun = in_block > 0.0 ? 1 : 0;
  const bool is_cut = done == blocks_.size();
  for (std::size_t i = done_cuts + (is_cut ? begun : 0); i < cuts; ++i) {
    *rest += blocks_[cut[i]].volume;
  }
  *rest += volume_near(done + (is_cut ? 0 : begun), solid_box, X_SL);
  return sum;
}

// @param solid  null where all of the element is inside
void VolumeElements::add(const VolumeElement& element, const Solid* solid,
                         const Eigen::Isometry3d& X_SL, ContactVolume* sum) {
  Eigen::Vector3d p = element.center.cast<double>(), o = element.outward.cast<double>();
  double share = 1.0;
  if (solid != nullptr) {
    const SignedDistance found = solid->signed_distance(X_SL * p);
    const Eigen::Vector3d n = X_SL.linear().transpose() * found.normal;
    const double width =
        std::sqrt(12.0 * std::max(n.dot(element.covariance.cast<double>() * n), 0.0));
    share = width > 0.0 ? std::clamp(0.5 - found.distance / width, 0.0, 1.0)
                        : (found.distance < 0.0 ? 1.0 : 0.0);
    if (!(share > 0.0)) return;
    p -= 0.5 * (1.0 - share) * width * n;  // the middle of the share
    // Inside, the solid's normal jumps where two faces are equally near, from the edges on.
    const double outside = std::max(1.0 - 2.0 * share, 0.0);
    o = (1.0 - outside) * o - outside * n;
  }
  const double volume = share * static_cast<double>(element.volume);
  sum->volume += volume;
  sum->weighted_normal += volume * o;
  sum->weighted_moment += p.cross(volume * o);
  ++sum->spheres;
}

}  // namespace ist
