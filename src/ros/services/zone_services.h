#pragma once

#include <ist_proximity/RemoveZone.h>
#include <ist_proximity/SetZone.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>

#include <mutex>
#include <string>
#include <vector>

#include "ros/input/zone_store.h"
#include "ros/model/model_loader.h"
#include "ros/output/markers.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// Answers ~set_zone and ~remove_zone, and shows and tells what zones there are. Thread safe.
class ZoneServices {
 public:
  /// @param config, buffer, loader, zones  outlive this
  ZoneServices(ros::NodeHandle private_nh, const ServerConfig& config,
               const TransformBuffer& buffer, const ModelLoader& loader, ZoneStore* zones);

  /// Shows the zones on ~zones as they are now.
  void show();
  /// What a user has to know of zones that do not do what they are for.
  std::vector<std::string> remarks() const;

 private:
  bool set(ist_proximity::SetZone::Request& request, ist_proximity::SetZone::Response& response);
  bool remove(ist_proximity::RemoveZone::Request& request,
              ist_proximity::RemoveZone::Response& response);
  std::string set_zone(const ist_proximity::SetZone::Request& request);
  std::string without_effect() const;

  const ServerConfig& config_;
  const TransformBuffer& buffer_;
  const ModelLoader& loader_;
  ZoneStore& zones_;
  std::mutex mutex_;  ///< guards the next one
  ShownMarkers shown_;
  ros::Publisher markers_;
  std::vector<ros::ServiceServer> services_;
};

}  // namespace ist
