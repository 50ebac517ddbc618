#pragma once

#include <utility>

#include "ist_proximity/robot/robot_model.h"
#include "proximity/link_surface.h"

namespace ist {

/// An object of the world as a link: its exact geometry, a coarse packing, and its surface.
struct WorldShape {
  /// @throws Cancelled when the request says so
  WorldShape(LinkModel model, const CancelRequest& cancelled)
      : link(std::move(model)), surface(link, cancelled) {}

  LinkModel link;
  LinkSurface surface;
};

}  // namespace ist
