#pragma once

#include <Eigen/Geometry>

#include "ist_proximity/robot/robot_model.h"
#include "proximity/link_surface.h"

namespace ist {

/// The box of everything that belongs to a link in contact and apart: its surface, what it
/// encloses, and the openings of its holes.
Eigen::AlignedBox3d whole_box(const LinkModel& link, const LinkSurface& surface);

/// An object of the world as a link: its exact geometry, a coarse packing, and its surface.
struct WorldShape {
  /// @throws Cancelled when the request says so
  WorldShape(LinkModel model, const CancelRequest& cancelled)
      : link(std::move(model)), surface(link, cancelled), box(whole_box(link, surface)) {}

  LinkModel link;
  LinkSurface surface;
  Eigen::AlignedBox3d box;  ///< [m] see whole_box(), in the object's frame
};

}  // namespace ist
