#pragma once

#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Pairs of links, by name.
using NamePairs = std::vector<std::pair<std::string, std::string>>;

/// Pairs of usable links that may collide: all except adjacent links (parent and child, also with
/// links without geometry between them), links that never move relative to each other, and those
/// that `ignored` names.
/// @param wanted   by link of the model: a pair needs two
/// @param ignored  in either order; names that the model lacks have no effect
std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored);

/// Selects the pairs that are in contact at rest: with all joints at zero, or at the limit nearest
/// to zero. A pair with a planar or floating joint between its links is not among them, because
/// such a joint has no rest.
std::vector<LinkPair> in_contact_at_rest(const std::shared_ptr<const RobotModel>& model,
                                         const Kinematics& kinematics,
                                         const std::vector<LinkPair>& pairs);

/// Reads the `<disable_collisions>` elements of an SRDF.
/// @throws ModelError when the text is no SRDF
NamePairs disabled_collisions(const std::string& srdf_xml);

}  // namespace ist
