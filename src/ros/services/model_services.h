#pragma once

#include <ist_proximity/AttachObject.h>
#include <ist_proximity/DetachObject.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <std_srvs/Trigger.h>

#include <vector>

#include "ros/input/source_memory.h"
#include "ros/model/model_loader.h"

namespace ist {

/// Answers the services that change the robot's model: ~reload_model, ~attach_object and
/// ~detach_object, and ~save_memory. Attaching has another thread, because it takes long and
/// because detaching or reloading cancels it.
class ModelServices {
 public:
  /// @param attaching  the queue of ~attach_object
  /// @param loader     outlives this
  /// @param memories   empty: there is no ~save_memory
  ModelServices(ros::NodeHandle private_nh, ros::CallbackQueue* attaching, ModelLoader* loader,
                const SourceMemories& memories);
  /// Cancels what is under way.
  ~ModelServices() { loader_.end_changes(); }

 private:
  bool reload(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool attach(ist_proximity::AttachObject::Request& request,
              ist_proximity::AttachObject::Response& response);
  bool detach(ist_proximity::DetachObject::Request& request,
              ist_proximity::DetachObject::Response& response);
  bool save(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  ModelLoader& loader_;
  const SourceMemories memories_;
  std::vector<ros::ServiceServer> services_;
};

}  // namespace ist
