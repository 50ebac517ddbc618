#pragma once

#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The rules of an SRDF on collisions. As in MoveIt, `<disable_collisions>` goes before
/// `<enable_collisions>`, and that before `<disable_default_collisions>`.
struct CollisionRules {
  /// Two names of links, the lesser first.
  using Pairs = std::set<std::pair<std::string, std::string>>;
  Pairs disabled;                   ///< `<disable_collisions>`
  Pairs enabled;                    ///< `<enable_collisions>`
  std::set<std::string> off;        ///< links of `<disable_default_collisions>`
  std::vector<std::string> doubts;  ///< elements and links that are not known; a sentence each

  /// Whether the pair is stated to be watched, also where its links are adjacent.
  bool enables(const std::string& a, const std::string& b) const;
  bool disables(const std::string& a, const std::string& b) const;  ///< not to be watched
};

/// Reads an SRDF's statements about collisions.
/// @param kinematics  of the URDF, to find links that it lacks; null: names are not compared
/// @param cancelled   true ends the reading; it is called every few milliseconds, and may be empty
/// @throws ModelError when the text is no SRDF, or the reading was cancelled
CollisionRules read_srdf(const std::string& srdf_xml, const Kinematics* kinematics,
                         const std::function<bool()>& cancelled = {});

/// The pairs are those without rules, less what the rules disable, and with adjacent links that
/// they enable.
std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored, const CollisionRules& rules);

/// Names the joints whose limits are not stated, and what sample_pairs() makes of them.
/// @returns a sentence without a full stop; empty: every joint is drawn over all its positions
std::string sampling_doubts(const Kinematics& kinematics);

}  // namespace ist
