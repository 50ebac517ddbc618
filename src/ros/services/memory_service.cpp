#include "ros/services/memory_service.h"

#include <string>

#include "ros/common/text.h"

namespace ist {

MemoryService::MemoryService(ros::NodeHandle private_nh, const SourceMemories& memories)
    : memories_(memories) {
  if (memories_.empty()) return;
  private_nh.setCallbackQueue(thread_.queue());
  service_ = private_nh.advertiseService("save_memory", &MemoryService::save, this);
  thread_.start("ist memory");
}

MemoryService::~MemoryService() {
  thread_.stop();
  service_.shutdown();
}

bool MemoryService::save(std_srvs::Trigger::Request& /*request*/,
                         std_srvs::Trigger::Response& response) {
  std::vector<std::string> texts;
  response.success = 1;
  for (const std::shared_ptr<SourceMemory>& memory : memories_) {
    bool is_saved = false;
    texts.push_back(memory->save(&is_saved));
    if (!is_saved) response.success = 0;
  }
  response.message = join(texts, "; ");
  return true;
}

}  // namespace ist
