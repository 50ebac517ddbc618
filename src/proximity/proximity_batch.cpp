#include "ist_proximity/proximity/proximity_batch.h"

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "internal/proximity/chunks.h"

namespace ist {

struct ProximityBatch::Impl {
  /// The query of one thread, and its buffers for one configuration.
  struct Worker {
    ProximityQuery query;
    std::vector<Eigen::Isometry3d> X_FL;
    std::vector<LinkProximity> results;
  };

  /// Calls answer(worker, k) for each configuration k, on all threads.
  /// @returns whether all calls returned true: no deadline passed
  template <class Answer>
  bool run(std::size_t count, const Answer& answer) {
    std::atomic<bool> complete{true};
    run_in_chunks(count, workers.size(), [&](std::size_t i, Chunks* chunks) {
      chunks->for_each([&](std::size_t k) {
        if (!answer(&workers[i], k)) complete = false;
      });
    });
    return complete;
  }

  /// Copies the poses of configuration k.
  void load(Span<const Eigen::Isometry3d> X_FL, std::size_t k, Worker* worker) const {
    std::copy_n(X_FL.begin() + k * links, links, worker->X_FL.begin());
  }

  /// The number of configurations; a rest of poses that is none is left out.
  std::size_t count(Span<const Eigen::Isometry3d> X_FL) const {
    return links == 0 ? 0 : X_FL.size() / links;
  }

  std::size_t links = 0;
  std::vector<Worker> workers;
};

ProximityBatch::ProximityBatch(
    std::shared_ptr<const RobotModel> model,  // NOLINT(performance-unnecessary-value-param): as the
    const QueryConfig& config, int threads)   // other queries take it
    : impl_(std::make_unique<Impl>()) {
  impl_->links = model->links.size();
  const std::size_t count = thread_count(threads);
  for (std::size_t i = 0; i < count; ++i) {
    impl_->workers.push_back({ProximityQuery(model, config),
                              std::vector<Eigen::Isometry3d>(impl_->links),
                              std::vector<LinkProximity>(impl_->links)});
  }
}
ProximityBatch::~ProximityBatch() = default;
ProximityBatch::ProximityBatch(ProximityBatch&&) noexcept = default;
ProximityBatch& ProximityBatch::operator=(ProximityBatch&&) noexcept = default;

bool ProximityBatch::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                         SnapshotSpan clouds, std::vector<LinkProximity>* results) {
  results->resize(X_FL.size());
  for (std::size_t i = impl_->count(X_FL) * impl_->links; i < results->size(); ++i) {
    (*results)[i].reset();
  }
  return impl_->run(impl_->count(X_FL), [&](Impl::Worker* worker, std::size_t k) {
    impl_->load(X_FL, k, worker);
    const bool complete = worker->query.run(worker->X_FL, known, clouds, &worker->results);
    std::copy(worker->results.begin(), worker->results.end(),
              results->begin() + static_cast<std::ptrdiff_t>(k * impl_->links));
    return complete;
  });
}

bool ProximityBatch::run_minimum(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                                 SnapshotSpan clouds, std::vector<RobotProximity>* results) {
  results->resize(impl_->count(X_FL));
  return impl_->run(results->size(), [&](Impl::Worker* worker, std::size_t k) {
    impl_->load(X_FL, k, worker);
    return worker->query.run_minimum(worker->X_FL, known, clouds, &(*results)[k]);
  });
}

}  // namespace ist
