#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <std_srvs/Trigger.h>

#include <memory>
#include <vector>

#include "ros/common/callback_thread.h"
#include "ros/input/source_memory.h"

namespace ist {

/// Answers ~save_memory in a thread of its own: writes the memories that have a memory/file. There
/// is no service without a memory.
class MemoryService {
 public:
  MemoryService(ros::NodeHandle private_nh, const SourceMemories& memories);
  ~MemoryService();
  MemoryService(const MemoryService&) = delete;
  MemoryService& operator=(const MemoryService&) = delete;

 private:
  bool save(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  const SourceMemories memories_;
  CallbackThread thread_;
  ros::ServiceServer service_;
};

}  // namespace ist
