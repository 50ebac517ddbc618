#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <string>

namespace ist {

/// The facts that the contract of a ProximityArray depends on.
struct InvariantInput {
  ros::Time now;              ///< the ROS clock's time after the poses were read
  double max_distance = 1.0;  ///< [m] ~max_distance
  double margin = 0.0;        ///< [m] ~query/margin that the message was made with
};

/// Checks what a ProximityArray promises, whatever is missing: a status with a text; a stamp that
/// is not in the future; ordered bounds that contain the margin; NaN and -inf where a link is
/// UNKNOWN; finite points, and a unit direction along which they lie, where it is NEAR or CONTACT.
/// Debug builds check each message that they publish.
/// @returns empty, or the first thing that is broken: link, field and value
std::string broken_invariant(const ist_proximity::ProximityArray& message,
                             const InvariantInput& input);

/// Ends a debug build with a message where an invariant is broken; does nothing in a release build.
void assert_invariants(const ist_proximity::ProximityArray& message, const InvariantInput& input);

}  // namespace ist
