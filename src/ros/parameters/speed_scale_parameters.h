#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include "ist_proximity/proximity/speed_scale.h"
#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Reads ~speed_scale/* at the start, and checks the values against one another. Distances that are
/// not set fit a ~max_distance below them.
SpeedScaleConfig read_speed_scale(ParameterReader* reader, double max_distance);

/// Reads ~speed_scale/* again and appends its tunables. Values that do not go together leave all of
/// the last ones. Links without an own distance at the start get none: the sentence says so.
/// @param tree     as fetch_parameters() returns it
/// @param reading  its config holds the last values
void read_live_speed_scale(const XmlRpc::XmlRpcValue& tree, double max_distance,
                           LiveReading* reading);

}  // namespace ist
