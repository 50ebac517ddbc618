#pragma once

#include <ist_proximity/QueryProximity.h>
#include <ros/node_handle.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "ros/common/callback_thread.h"
#include "ros/services/self_query_answer.h"
#include "ros/services/stated_cycle.h"

namespace ist {

/// Answers ~query in a thread of its own with a query of its own, so that requests never delay the
/// cycle. ~query/deadline does not apply here; the number of answers bounds a request's time and
/// memory.
class QueryService {
 public:
  /// @param meanwhile  what else that thread does: called 20 times a second or more often, also
  ///                   during a long request; throws nothing
  QueryService(const AddOnContext& node, std::function<void()> meanwhile);
  ~QueryService();

  /// Ends the service's thread.
  void stop() { thread_.stop(); }

  /// The queue of that thread.
  ros::CallbackQueue* queue() { return thread_.queue(); }

 private:
  using Service = ist_proximity::QueryProximity;

  bool answer(Service::Request& request, Service::Response& response);
  std::string run(const Service::Request& request, Service::Response* response);
  std::string find_impact_times(const Service::Request& request,
                                const std::vector<std::vector<double>>& positions,
                                const QueryConfig& query, Service::Response* response);
  std::string choose_links(const std::vector<std::string>& links);
  std::string check_size(const Service::Request& request) const;
  void return_memory();

  const std::function<LiveConfig()> live_;
  const std::function<void()> meanwhile_;
  CallbackThread thread_;
  ros::ServiceServer service_;

  StatedCycle stated_;  ///< used by the service's thread alone, as all that follows

  SelfQueryAnswer self_;
  std::vector<bool> chosen_;  ///< by monitored link
  /// After a large answer, memory is returned to the system until then: roscpp frees the answer
  /// after answer().
  std::chrono::steady_clock::time_point return_memory_until_, next_return_;
};

}  // namespace ist
