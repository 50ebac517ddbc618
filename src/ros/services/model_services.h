#pragma once

#include <ist_proximity/AttachObject.h>
#include <ist_proximity/DetachObject.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <std_srvs/Trigger.h>

#include "ros/common/callback_thread.h"
#include "ros/input/source_memory.h"
#include "ros/model/model_loader.h"

namespace ist {

/// Answers the services that change the robot's model: ~reload_model, ~attach_object and
/// ~detach_object, and ~save_memory, in threads of their own. Attaching has a thread for itself,
/// because it takes long and because detaching or reloading cancels it.
class ModelServices {
 public:
  /// @param loader  outlives this
  ModelServices(ros::NodeHandle private_nh, ModelLoader* loader);
  /// Cancels what is under way.
  ~ModelServices();

  /// Advertises ~save_memory, which writes the memories that have a memory/file.
  void offer(ros::NodeHandle private_nh, const SourceMemories& memories);

 private:
  bool reload(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool attach(ist_proximity::AttachObject::Request& request,
              ist_proximity::AttachObject::Response& response);
  bool detach(ist_proximity::DetachObject::Request& request,
              ist_proximity::DetachObject::Response& response);
  bool save(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  ModelLoader& loader_;
  CallbackThread thread_, attach_thread_;
  ros::ServiceServer reload_service_, attach_service_, detach_service_, save_service_;
  SourceMemories memories_;
};

}  // namespace ist
