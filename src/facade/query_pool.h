#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {

/// The query and the buffers with which one thread answers configurations of a robot.
struct QueryWorker {
  QueryWorker(const std::shared_ptr<const RobotModel>& model,
              const std::shared_ptr<const Kinematics>& kinematics)
      : query(model, {}),
        forward(*model, kinematics),
        q(kinematics->joints().size(), std::numeric_limits<double>::quiet_NaN()),
        known(model->links.size()),
        results(model->links.size()) {}

  ProximityQuery query;
  ForwardKinematics forward;
  std::vector<double> q;  ///< [rad, m] by joint of the kinematics
  std::vector<bool> known;
  std::vector<LinkProximity> results;
};

/// Workers that are kept for the next call, as making one takes longer than a query. Thread safe.
class QueryPool {
 public:
  using Maker = std::function<std::unique_ptr<QueryWorker>()>;

  explicit QueryPool(Maker make) : make_(std::move(make)) {}

  /// Calls answer(worker, k) for each k < count, on up to `threads` threads (0: one for each core),
  /// consecutive ones by one worker. The first exception comes out when all threads have ended.
  void run(std::size_t count, int threads, const QueryConfig& config,
           const std::function<void(QueryWorker*, std::size_t)>& answer);

 private:
  std::unique_ptr<QueryWorker> take();
  void give_back(std::unique_ptr<QueryWorker> worker);

  Maker make_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<QueryWorker>> idle_;  // under mutex_
};

}  // namespace ist
