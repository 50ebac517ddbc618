#pragma once

#include <ros/master.h>

#include <chrono>
#include <optional>
#include <string>

namespace ist {

/// A sentence for somebody whose topic stays silent: that it has another type, or else which topics
/// a source could have.
/// @param topic   resolved
/// @param type    message type that the source expects
/// @param own     topic of the node itself, which is left out
/// @param topics  all that are published
std::string advice_on_topic(const std::string& topic, const std::string& type,
                            const std::string& own, const ros::master::V_TopicInfo& topics);

/// Asks the master which topics are published, now and then. The answer may take long, so no lock
/// should be held around ask(). Not thread safe.
class TopicAdvice {
 public:
  /// The same as for advice_on_topic().
  TopicAdvice(std::string topic, std::string type, std::string own);

  /// Returns the sentence when it is due and the master answers, else nothing.
  std::optional<std::string> ask();

 private:
  const std::string topic_, type_, own_;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace ist
