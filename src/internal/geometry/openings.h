#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/convex_part.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// The places where the inside of a link's meshes with holes ends without a surface. A mesh's
/// winding number changes by an integer at its surface, and elsewhere smoothly. The gradient is
/// that of the triangles (caps) that would close its holes: no more than 2 A / (4 pi d^3) for caps
/// of area A at a distance d; and it is the Biot-Savart field of the open edges: no more than l /
/// (4 pi d^2) for edges of length l, with a derivative of no more than 2 l / (4 pi d^3). That
/// bounds, from the winding number of one point, those of all points about it; so most places are
/// known not to hold a point where the winding number is 0.5. The cells of an octree that are left
/// hold all openings. Immutable; const members are thread safe and allocate nothing.
class Openings {
 public:
  Openings() = default;
  /// Takes up to some tenths of a second for a mesh with thousands of open edges.
  /// @throws Cancelled when the request says so
  explicit Openings(const Solid& solid, const CancelRequest& cancelled = {});

  /// Spheres, in the link's frame, that hold all openings; `number` is the place of the element's
  /// entry. Empty for closed links.
  const std::vector<ConvexPart>& cells() const { return cells_; }

  /// Knowledge about the points of a sphere.
  enum class Side {
    kOutside,    ///< its centre is outside, and no opening of the element is in the sphere
    kInside,     ///< its centre is inside the element
    kMayChange,  ///< not decided
  };
  /// @param element  the number of a cell
  Side side(std::uint32_t element, const Eigen::Vector3d& center_L, double radius) const;

 private:
  /// A part of a boundary or of a cap, in L.
  struct Piece {
    Eigen::Vector3d middle;  ///< [m]
    double radius;           ///< [m] of the sphere about it that holds the piece
    double weight;           ///< [m, m^2] length or twice the area, over 4 pi
    Eigen::Vector3d along;   ///< [m] of an edge: from the middle to its end; else zero
  };
  /// The open edges of one or more holes that are connected, and their caps.
  struct Hole {
    Piece edges, caps;  ///< all of them
    std::vector<Piece> single_edges, single_caps;
    std::vector<double> count;  ///< by edge: missing partners
  };
  struct Variation;
  struct Element {
    std::size_t index;  ///< in the solid
    std::vector<Hole> holes;
  };
  Eigen::AlignedBox3d add_element(std::size_t index, const CancelRequest& cancelled);
  struct Winding {
    double number, error;  ///< the winding number at a place
  };
  static bool may_hold_opening(const Element& element, const Winding& winding,
                               const Eigen::Vector3d& center_L, double radius);
  void add_cells(std::uint32_t number, const Eigen::AlignedBox3d& box,
                 const CancelRequest& cancelled);

  Solid solid_;
  std::vector<Element> elements_;
  std::vector<ConvexPart> cells_;
};

}  // namespace ist
