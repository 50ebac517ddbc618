#include "packing_jobs.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <optional>
#include <utility>

#include "first_packing.h"
#include "internal/packing/packer.h"
#include "internal/robot/threads.h"

namespace ist {

PackingJobs::PackingJobs(std::vector<PackingJob>* jobs, const PackingCache& cache, Report report)
    : jobs_(*jobs),
      cache_(cache),
      report_(std::move(report)),
      order_(jobs->size()),
      done_(jobs->size(), 0.0) {
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(),
                   [&](std::size_t a, std::size_t b) { return jobs_[a].work > jobs_[b].work; });
}

bool PackingJobs::run(int threads) {
  run_on_threads(std::min(thread_count(threads), jobs_.size()), [this](std::size_t) { work(); });
  if (failure_) std::rethrow_exception(failure_);
  return !stopped_;
}

void PackingJobs::work() {
  for (std::size_t index; take(&index);) {
    pack(index);
    finish(index);
  }
}

bool PackingJobs::take(std::size_t* index) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stopped_ || next_ == order_.size()) return false;
  *index = order_[next_++];
  at_work_.push_back(*index);
  return true;
}

void PackingJobs::finish(std::size_t index) {
  const std::lock_guard<std::mutex> lock(mutex_);
  at_work_.erase(std::find(at_work_.begin(), at_work_.end(), index));
}

void PackingJobs::pack(std::size_t index) {
  PackingJob& job = jobs_[index];
  if (!report(index, 0.0)) return;
  const auto start = std::chrono::steady_clock::now();
  bool stopped = false;
  try {
    std::optional<Packing> cached;
    if (job.look_in_cache) {
      cached = cache_.load(
          job.key, *job.shape, job.config,
          [&](double) { return !(stopped = stopped || !report(index, 0.0)); }, &job.load_warning);
    }
    job.from_cache = job.is_final = cached.has_value();
    if (job.from_cache) {
      job.packing = std::move(*cached);
    } else if (!stopped) {
      const auto progress = [&](double fraction) {
        stopped = stopped || !report(index, fraction);
        return !stopped;
      };
      job.packing =
          pack_element(*job.shape, job.now, progress, job.surface ? &*job.surface : nullptr);
      job.is_final = is_final(job.packing, job.now, job.config);
      PackingCertificate& certificate = job.packing.certificate;
      certificate.reached = certificate.max_gap <= job.config.max_error;
      if (!stopped && job.is_final) cache_.store(job.key, job.packing, &job.store_warning);
    }
  } catch (const std::exception& error) {
    job.error = error.what();
  }
  job.time = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!stopped) report(index, 1.0);
}

bool PackingJobs::report(std::size_t index, double fraction) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stopped_) return false;
  done_[index] = std::max(done_[index], std::min(fraction, 1.0));
  double done = 0.0, all = 0.0;
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    done += jobs_[i].work * done_[i];
    all += jobs_[i].work;
  }
  try {
    // Another thread may be in a long phase of a link that was begun before this one.
    stopped_ = !report_(jobs_[at_work_.front()], done / all);
  } catch (...) {
    failure_ = std::current_exception();
    stopped_ = true;
  }
  return !stopped_;
}

}  // namespace ist
