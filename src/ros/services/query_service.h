#pragma once

#include <ist_proximity/QueryProximity.h>
#include <ros/node_handle.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ist_proximity/proximity/time_of_impact.h"
#include "ros/common/callback_thread.h"
#include "ros/cycle/proximity_cycle.h"
#include "ros/input/unknown_space.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/stated_pose_source.h"
#include "ros/services/self_query_answer.h"

namespace ist {

/// Answers ~query in a thread of its own with a query of its own, so that requests never delay the
/// cycle. ~query/deadline does not apply here; the number of answers bounds a request's time and
/// memory.
class QueryService {
 public:
  /// @param sources, buffer  outlive this
  /// @param watch            outlives this; null with ~unknown_space free
  /// @param live             gives the present configuration; called from the service's thread
  /// @param meanwhile        what else that thread does: called 20 times a second or more often,
  ///                         also during a long request; throws nothing
  QueryService(ros::NodeHandle private_nh, const ServerConfig& config, const CloudSources& sources,
               const TransformBuffer& buffer, std::function<LiveConfig()> live,
               UnknownSpaceWatch* watch, std::function<void()> meanwhile);
  ~QueryService();

  /// Thread safe.
  void set_model(std::shared_ptr<const ModelState> model);

 private:
  using Service = ist_proximity::QueryProximity;

  bool answer(Service::Request& request, Service::Response& response);
  std::string run(const Service::Request& request, Service::Response* response);
  std::string find_impact_times(const Service::Request& request,
                                const std::vector<std::vector<double>>& positions,
                                const QueryConfig& query, Service::Response* response);
  std::string take_model();
  std::string choose_links(const std::vector<std::string>& links);
  std::string check_size(const Service::Request& request) const;
  void return_memory();

  const ServerConfig config_;
  const CloudSources& sources_;
  const TransformBuffer& buffer_;
  const std::function<LiveConfig()> live_;
  UnknownSpaceWatch* const watch_;  ///< null with ~unknown_space free
  const std::function<void()> meanwhile_;
  CallbackThread thread_;
  ros::ServiceServer service_;

  std::mutex mutex_;
  std::shared_ptr<const ModelState> newest_model_;

  // Used by the service's thread alone.
  std::shared_ptr<const ModelState> model_;
  StatedPoseSource* poses_ = nullptr;  ///< owned by the cycle
  std::unique_ptr<ProximityCycle> cycle_;
  std::unique_ptr<TimeOfImpact> impacts_;
  SelfQueryAnswer self_;
  std::vector<bool> chosen_;  ///< by monitored link
  /// Memory of a large answer is until then returned to the system: roscpp frees it after
  /// answer().
  std::chrono::steady_clock::time_point return_memory_until_, next_return_;
};

}  // namespace ist
