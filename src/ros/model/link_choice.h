#pragma once

#include <string>
#include <vector>

#include "internal/robot/coarse_hulls.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "ist_proximity/robot/robot_description.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// What the links of a robot are used for, by name.
struct LinkChoice {
  std::vector<std::string> monitored;  ///< in the order of the URDF; then those that it lacks
  /// Not monitored, but measured against the links that the SRDF enables them with.
  std::vector<std::string> paired;
  std::vector<std::string> filtering;  ///< whose points self-filters drop; empty without any
  std::string remarks;                 ///< what is not as one might expect; sentences, or empty
  std::vector<std::string> warnings;   ///< what the user should look at; a sentence each

  /// The links that the model holds.
  std::vector<std::string> packed() const;
};

/// Adds a name that is not among them yet.
void add_name(const std::string& name, std::vector<std::string>* names);

/// Chooses the links: those of ~links, or else all with geometry but for coarse hulls that the SRDF
/// disables by default. Those of ~self_filter_links filter, or else the monitored ones; for a
/// coarse hull the link that it is drawn around does: a link that does not filter shows in contact
/// with itself at worst, where one that filters hides what is beside the robot.
LinkChoice choose_links(const RobotDescription& robot, const CollisionRules& rules,
                        const std::vector<CoarseHull>& hulls, const ServerConfig& config);

}  // namespace ist
