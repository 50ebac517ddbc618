#include "ros/services/model_services.h"

#include "ist_proximity/robot/robot_description.h"
#include "ros/common/text.h"
#include "ros/services/object_conversion.h"

namespace ist {

ModelServices::ModelServices(ros::NodeHandle private_nh, ros::CallbackQueue* attaching,
                             ModelLoader* loader, const SourceMemories& memories)
    : loader_(*loader), memories_(memories) {
  services_ = {private_nh.advertiseService("reload_model", &ModelServices::reload, this),
               private_nh.advertiseService("detach_object", &ModelServices::detach, this)};
  if (!memories.empty()) {
    services_.push_back(private_nh.advertiseService("save_memory", &ModelServices::save, this));
  }
  private_nh.setCallbackQueue(attaching);
  services_.push_back(private_nh.advertiseService("attach_object", &ModelServices::attach, this));
}

bool ModelServices::save(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
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

bool ModelServices::reload(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  bool found = false;
  response.message = loader_.reload(&found);
  response.success = found;
  return true;
}

bool ModelServices::attach(ist_proximity::AttachObject::Request& request,
                           ist_proximity::AttachObject::Response& response) {
  response.message = loader_.attach(request.name, [&](const CancelRequest& cancelled) {
    return to_object(request, environment_package_finder(), cancelled);
  });
  response.success = response.message.empty();
  if (response.success) {
    response.message = "'" + request.name + "' is now part of link '" + request.link + "'";
  }
  return true;
}

bool ModelServices::detach(ist_proximity::DetachObject::Request& request,
                           ist_proximity::DetachObject::Response& response) {
  response.message = loader_.detach(request.name);
  response.success = response.message.empty();
  if (response.success) response.message = "'" + request.name + "' is detached";
  return true;
}

}  // namespace ist
