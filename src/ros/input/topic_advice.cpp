#include "ros/input/topic_advice.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "ros/common/text.h"
#include "ros/parameters/source_config.h"

namespace ist {
namespace {

// Drivers start in their own time: the first answer would be out of date at once.
constexpr std::chrono::seconds kFirst{1}, kBetween{5};
constexpr std::size_t kMostTopics = 8;  // a status_text is meant to be read

bool is_source_type(const std::string& type) {
  for (const SourceType one :
       {SourceType::kCloud, SourceType::kDepthImage, SourceType::kScan, SourceType::kMap}) {
    if (type == message_type(one)) return true;
  }
  return false;
}

std::string list(const std::vector<std::string>& names) {
  const std::size_t shown = std::min(names.size(), kMostTopics);
  std::string text =
      join({names.begin(), names.begin() + static_cast<std::ptrdiff_t>(shown)}, ", ");
  if (names.size() > shown) text += " and " + std::to_string(names.size() - shown) + " more";
  return text;
}

/// @param topics  all that are published
std::string advice_on_topic(const std::string& topic, const std::string& type,
                            const std::string& own, const ros::master::V_TopicInfo& topics) {
  std::vector<std::string> same, others;
  for (const ros::master::TopicInfo& info : topics) {
    if (info.name == topic && info.datatype != type) {
      return is_source_type(info.datatype)
                 ? topic + " is a " + info.datatype +
                       ": give the source that type (~sources/NAME/" + "type), or another topic"
                 : topic + " is a " + info.datatype + ", which no source reads";
    }
    if (info.name == topic) return "";  // all is well, or about to be
    if (info.name == own || !is_source_type(info.datatype)) continue;
    (info.datatype == type ? same : others).push_back(info.name + " (" + info.datatype + ")");
  }
  std::sort(same.begin(), same.end());
  std::sort(others.begin(), others.end());
  same.insert(same.end(), others.begin(), others.end());
  return same.empty() ? "no topic that a source could have is published"
                      : "published are " + list(same);
}

}  // namespace

TopicAdvice::TopicAdvice(std::string topic, std::string type, std::string own)
    : topic_(std::move(topic)),
      type_(std::move(type)),
      own_(std::move(own)),
      next_(std::chrono::steady_clock::now() + kFirst) {}

std::optional<std::string> TopicAdvice::ask() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return std::nullopt;
  next_ = now + kBetween;
  // Unlike ros::master::getTopics(), this does not wait for a master that is gone.
  XmlRpc::XmlRpcValue request, response, published;
  request[0] = ros::this_node::getName();
  request[1] = "";
  if (!ros::master::execute("getPublishedTopics", request, response, published, false)) {
    return std::nullopt;
  }
  ros::master::V_TopicInfo topics;
  for (int i = 0; i < published.size(); ++i) {
    topics.emplace_back(std::string(published[i][0]), std::string(published[i][1]));
  }
  return advice_on_topic(topic_, type_, own_, topics);
}

}  // namespace ist
