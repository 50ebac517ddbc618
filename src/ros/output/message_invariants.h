#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <string>
#include <vector>

#include "ros/parameters/parameters.h"

namespace ist {

/// The facts that the contract of a ProximityArray depends on.
struct InvariantInput {
  ros::Time now;              ///< the ROS clock's time after the poses were read
  double max_distance = 1.0;  ///< [m] ~max_distance
  double margin = 0.0;        ///< [m] ~query/margin that the message was made with
};

/// Checks what a ProximityArray promises, whatever is missing: a status with a text; a stamp that
/// is not in the future; links that are UNKNOWN while no
/// source vouches for anything; ordered bounds that contain the margin; NaN and -inf where a link
/// is UNKNOWN; finite points, and a unit direction along which they lie, where it is NEAR or
/// CONTACT. Debug builds check each message that they publish.
/// @returns empty, or the first thing that is broken: link, field and value
std::string broken_invariant(const ist_proximity::ProximityArray& message,
                             const InvariantInput& input);

/// [m] The least lower bound of a CLEAR link: ~max_distance, unless unknown space is an obstacle.
double least_when_clear(const ServerConfig& config);

/// Checks what the whole robot's distances come to: one number, the links' lower bounds, decides.
/// ~min_distance is none of the counted links' lower bounds or less where one is UNKNOWN or nothing
/// is known to be free; and a scale above 0 needs a bound above 0 for each of them.
/// @param counts        by link: whether it counts
/// @param min_distance  [m] as published; NaN: not known
/// @param scale         as published; 0 where none is
/// @returns empty, or what is broken
std::string broken_agreement(const ist_proximity::ProximityArray& message,
                             const std::vector<bool>& counts, double min_distance, double scale);

/// Ends a debug build with a message where an invariant is broken; does nothing in a release build.
void assert_invariants(const ist_proximity::ProximityArray& message, const InvariantInput& input);
void assert_agreement(const ist_proximity::ProximityArray& message, const std::vector<bool>& counts,
                      double min_distance, double scale);

}  // namespace ist
