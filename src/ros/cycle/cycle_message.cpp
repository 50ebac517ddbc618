#include "ros/cycle/cycle_message.h"

#include <cstddef>

#include "ros/output/message_conversion.h"

namespace ist {

using ist_proximity::ProximityArray;

void fill_status(const StatusInput& input, const Status& status, ProximityArray* message) {
  message->sources.resize(input.sources.size());
  for (std::size_t i = 0; i < input.sources.size(); ++i) {
    assign_source(input.sources[i], input.source_statuses[i], message->header.stamp,
                  &message->sources[i]);
  }
  message->status = status.code;
  message->status_text = status.text;
}

void fill_without_model(const ModelState& model, const ServerConfig& config, const ros::Time& now,
                        const CloudSources& sources, ProximityArray* message, CycleReport* report) {
  StatusInput input;
  input.model_problem = model.problem;
  input.is_loading = model.is_loading();
  input.clock_runs = !now.isZero();
  for (const auto& source : sources) {
    input.sources.emplace_back();
    source->report(&input.sources.back());
    input.source_statuses.push_back(source_status(input.sources.back(), now.toSec()));
  }
  *message = ProximityArray();
  message->header.stamp = now;
  message->header.frame_id = fixed_frame_of(model, config);
  for (const std::string& link : model.links) message->links.push_back(unknown_link(link));
  const Status status = overall_status(input, now.toSec());
  fill_status(input, status, message);
  report->take(input, status);
  report->links_monitored = model.links.size();
  report->links_known = 0;
}

}  // namespace ist
