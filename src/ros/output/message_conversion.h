#pragma once

#include <ist_proximity/LinkPairProximity.h>
#include <ist_proximity/LinkProximity.h>
#include <ist_proximity/ProximityArray.h>
#include <ist_proximity/SourceStatus.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "internal/proximity/surroundings.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ros/input/source_report.h"

namespace ist {

/// Makes the message of an UNKNOWN link: NaN everywhere, lower bound -inf.
ist_proximity::LinkProximity unknown_link(const std::string& name);

/// Makes the message of a link; every field of `message` is overwritten, and its memory is kept.
/// @param result       in the fixed frame
/// @param penetration  in the fixed frame, about the link's origin
/// @param source       name of the source of the nearest point; ignored unless NEAR or CONTACT
void assign_link(const std::string& name, const LinkProximity& result,
                 const RepulsiveWrench& repulsion, const Wrench& penetration,
                 const ClosingRates& closing, const std::string& source,
                 ist_proximity::LinkProximity* message);

ist_proximity::LinkPairProximity pair_message(const RobotModel& robot, const LinkPair& pair,
                                              const PairProximity& result);

/// @param box_L  [m] in the link's frame; empty: not known
void assign_box(const Eigen::AlignedBox3d& box_L, ist_proximity::LinkProximity* message);

/// Adds what is known of unknown space.
/// @param lower_bound    [m] of the distance to it
/// @param direction      towards it
/// @param is_obstacle    whether it counts in the link's `lower_bound`
void assign_unknown_space(const SeenShare& seen, double lower_bound,
                          const Eigen::Vector3d& direction, bool is_obstacle,
                          ist_proximity::LinkProximity* message);

/// Makes the message of a source, as assign_link() does.
/// @param stamp  of the ProximityArray, from which `age` counts
void assign_source(const SourceReport& source, const ros::Time& stamp,
                   ist_proximity::SourceStatus* message);

/// Whether a message says that a source which is required cannot be used, so that nothing is known,
/// or that the robot's model is not complete yet.
bool is_incomplete(const ist_proximity::ProximityArray& message);

/// [s] For how long the obstacles of a message may have moved: since its oldest cloud was measured,
/// or received where its stamp was ahead of the clock.
double obstacle_age(const ist_proximity::ProximityArray& message, const ros::Time& now);

/// Gives the smallest lower bound [m] of the links that count; NaN when one of them is UNKNOWN,
/// when none counts, and where is_incomplete(). All CLEAR gives ~max_distance.
/// @param counts  by link of the message; another length: every link counts
double min_distance(const ist_proximity::ProximityArray& message, const std::vector<bool>& counts);

}  // namespace ist
