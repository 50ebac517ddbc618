#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace ist {

/// A sentence for somebody whose topic stays silent: that it has another type, or else which topics
/// a source could have. The master is asked now and then; it may take long to answer, so no lock
/// should be held around ask(). Not thread safe.
class TopicAdvice {
 public:
  /// @param topic  resolved
  /// @param type   message type that the source expects
  /// @param own    topic of the node itself, which is left out
  TopicAdvice(std::string topic, std::string type, std::string own);

  /// Returns the sentence when it is due and the master answers, else nothing.
  std::optional<std::string> ask();

 private:
  const std::string topic_, type_, own_;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace ist
