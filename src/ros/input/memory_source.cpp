#include "ros/input/memory_source.h"

namespace ist {

void MemorySource::report(SourceReport* report) {
  *report = SourceReport();
  report->name = memory_->config().name + "/memory";
  report->topic = topic_;
  report->type = "octomap_msgs/Octomap";
  report->noun = "memory";
  report->is_memory = true;
  report->measures = false;
  report->required = false;
  memory_->report(report);
}

}  // namespace ist
