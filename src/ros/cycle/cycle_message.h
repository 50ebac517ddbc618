#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <string>

#include "ros/input/obstacle_source.h"
#include "ros/model/model_state.h"
#include "ros/status/cycle_report.h"
#include "ros/status/status.h"

namespace ist {

/// Fills the status, its text and the sources of a message.
void fill_status(const StatusInput& input, const Status& status,
                 ist_proximity::ProximityArray* message);

/// Fills the whole message while there is no model: MODEL_ERROR or LOADING, and every
/// link UNKNOWN.
void fill_without_model(const ModelState& model, const ServerConfig& config, const ros::Time& now,
                        const CloudSources& sources, ist_proximity::ProximityArray* message,
                        CycleReport* report);

}  // namespace ist
