#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "contact/contact_frontier.h"
#include "contact/volume_bound.h"
#include "internal/bvh/box_node.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/contact/contact_volume.h"

namespace ist {

/// Sums the contact volume of one link with points and leaves of maps, best first: the group of
/// points that may share the greatest volume with the link is summed next. The sum is at any time a
/// lower bound of the whole, and with the bounds of what is left an upper one. It runs once.
class ObstacleContact {
 public:
  /// All parameters outlive it; see contact_volume().
  ObstacleContact(const LinkModel& link, const ContactGeometry& geometry,
                  const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, TimePoint end);

  ContactVolume run();

 private:
  using Entry = ContactFrontier::Entry;
  /// An upper bound of what parts of a leaf of a map share with the link.
  struct CellBound {
    Eigen::AlignedBox3d reach;  ///< holds all of every cell that counts
    double density;             ///< see greatest_density()
    double of(const Eigen::AlignedBox3d& part) const {
      const Eigen::AlignedBox3d counting = part.intersection(reach);
      return counting.isEmpty() ? 0.0 : density * counting.volume();
    }
  };

  // Each snapshot has two hierarchies: of its points, and of the leaves of its map.
  const CloudSnapshot& cloud(std::uint32_t index) const { return *clouds_[index / 2]; }
  static bool is_map(std::uint32_t index) { return index % 2 == 1; }
  bool is_there(std::uint32_t index) const;
  const std::vector<BoxNode>& nodes(std::uint32_t index) const;
  bool is_leaf(std::uint32_t index, std::int32_t child) const;
  void enter(std::uint32_t index);

  void add_roots();
  void sum_entry(const Entry& entry);
  template <typename Visit>
  void visit_children(const Entry& entry, const Visit& visit);
  void sum_subtree(const Entry& entry);
  void sum_leaf(const Entry& entry);
  void sum_points(std::int32_t leaf);
  void sum_boxes(std::int32_t child);
  void sum_cells(const Eigen::AlignedBox3d& box, const CellBound& bound, int halvings);
  template <typename Weight>
  void add(const Eigen::Vector3d& p_L, double radius, const Weight& weight);

  bool may_enter(const Eigen::Vector3d& p_L, double radius) const;
  /// [m^3] What a child's points or boxes share with the link, at most; infinity where nobody knows
  /// yet, 0 where they cannot touch it.
  double bound_of(const BoxNode& node, int k) const;
  double bound_of_points(const Eigen::AlignedBox3d& box, std::int32_t child) const;
  CellBound bound_of_cells(const Eigen::AlignedBox3d& box) const;
  void tighten();

  const LinkModel& link_;
  const ContactGeometry& geometry_;
  const Eigen::Isometry3d X_LF_;
  const SnapshotSpan clouds_;
  Deadline deadline_;
  ContactFrontier frontier_;
  VolumeBound whole_;
  ContactVolume sum_;
  double rest_ = 0.0;        ///< [m^3] sum of the finite bounds in the frontier
  std::size_t unknown_ = 0;  ///< entries with an infinite one, and that of the entry being summed
  double current_ = 0.0;     ///< [m^3] bound of what is left of the entry that is being summed

  // The hierarchy that was entered, in its frame O.
  std::uint32_t index_ = std::numeric_limits<std::uint32_t>::max();
  Eigen::Isometry3d X_LO_ = Eigen::Isometry3d::Identity();
  Eigen::AlignedBox3d link_box_;  ///< about all points that count
  double radius_ = 0.0;           ///< [m] of points' spheres, or the longest edge of cells
};

}  // namespace ist
