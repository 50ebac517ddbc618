#include "ros/cycle/cycle_message.h"

#include <cstddef>

#include "ros/output/message_conversion.h"

namespace ist {

using ist_proximity::ProximityArray;

void fill_status(const StatusInput& input, const ros::Time& now, ProximityArray* message,
                 CycleReport* report) {
  message->sources.clear();
  for (std::size_t i = 0; i < input.sources.size(); ++i) {
    message->sources.push_back(
        to_message(input.sources[i], input.source_statuses[i], message->header.stamp));
  }
  report->status = overall_status(input, now.toSec());
  message->status = report->status.code;
  message->status_text = report->status.text;
  report->sources = input.sources;
  report->source_statuses = input.source_statuses;
  report->pose_problems = input.pose_problems;
}

void fill_without_model(const ModelState& model, const ServerConfig& config, const ros::Time& now,
                        const CloudSources& sources, ProximityArray* message, CycleReport* report) {
  StatusInput input;
  input.model_problem = model.problem;
  input.clock_runs = !now.isZero();
  for (const auto& source : sources) {
    input.sources.push_back(source->report());
    input.source_statuses.push_back(source_status(input.sources.back(), now.toSec()));
  }
  *message = ProximityArray();
  message->header.stamp = now;
  message->header.frame_id = fixed_frame_of(model, config);
  for (const std::string& link : model.links) message->links.push_back(unknown_link(link));
  fill_status(input, now, message, report);
  report->links_monitored = model.links.size();
  report->links_known = 0;
}

}  // namespace ist
