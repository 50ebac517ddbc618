#pragma once

#include <string>
#include <vector>

#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// The monitored links that count in ~min_distance, ~speed_scale and the summary of the
/// diagnostics.
struct CountedLinks {
  std::vector<std::string> links;  ///< names of the monitored links, as in every message
  std::vector<bool> counts;        ///< by monitored link
  std::string explanation;         ///< which links do not count, and why; empty: all do
  std::string problem;             ///< names in ~ignore_links that are no links; empty: none
};

/// Decides which links count: not those in ~ignore_links, and not those that cannot move in the
/// fixed frame, unless ~min_distance/fixed_links says so. A link of which that is not known counts.
/// The fixed links count where no link can move, and none is left.
/// @param ignored  names, beside those of ~ignore_links
/// @param root_stands_still  whether tf states that the root link never moves in a fixed frame that
///                           the URDF lacks
CountedLinks counted_links(const ModelState& model, const ServerConfig& config,
                           const std::vector<std::string>& ignored, bool root_stands_still);

/// Whether the fixed frame is no link of the model's URDF, so that `root_stands_still` decides.
bool has_frame_outside(const ModelState& model, const ServerConfig& config);

}  // namespace ist
