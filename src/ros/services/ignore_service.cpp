#include "ros/services/ignore_service.h"

#include <ros/console.h>

#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kLongest = 3600.0;  // [s]

}  // namespace

IgnoreService::IgnoreService(ros::NodeHandle private_nh, const ModelLoader& loader)
    : loader_(loader),
      service_(private_nh.advertiseService("ignore_links", &IgnoreService::ignore, this)) {}

std::vector<std::string> IgnoreService::names(const ros::Time& now) const {
  std::vector<std::string> names;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& [name, lifetime] : links_) {
    if (!lifetime.is_over(now)) names.push_back(name);
  }
  return names;
}

std::string IgnoreService::fault_of(const ist_proximity::IgnoreLinks::Request& request) const {
  if (!(request.lifetime >= 0.0 && request.lifetime <= kLongest)) {
    return format_text("lifetime is %g s; allowed is 0 (they count again) to %g s",
                       request.lifetime, kLongest);
  }
  if (request.links.empty()) return "links is empty: name those that are to be left out";
  return unmonitored_name(request.links, *loader_.state());
}

bool IgnoreService::ignore(ist_proximity::IgnoreLinks::Request& request,
                           ist_proximity::IgnoreLinks::Response& response) {
  response.message = fault_of(request);
  response.success = response.message.empty();
  if (!response.success) {
    response.message = "no link is left out: " + response.message;
    return true;
  }
  const ros::Time now = ros::Time::now();
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const std::string& name : request.links) {
    links_.erase(name);
    if (request.lifetime > 0.0) links_.try_emplace(name, request.lifetime, now);
  }
  response.message =
      join(request.links, ", ") +
      (request.lifetime > 0.0
           ? format_text(" left out of ~min_distance and ~speed_scale for %g s", request.lifetime)
           : " counted again, unless ~ignore_links names it");
  ROS_INFO_STREAM(response.message);
  return true;
}

}  // namespace ist
