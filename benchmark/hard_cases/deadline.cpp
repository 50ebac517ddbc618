#include "hard_cases/deadline.h"

#include <algorithm>
#include <limits>
#include <random>

#include "ist_proximity/cloud/ingest.h"
#include "support.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

constexpr double kPeriod = 0.001;   // [s] between two queries
constexpr double kRounding = 2e-6;  // [m] of a cloud's float coordinates

class DeadlineTrial {
 public:
  DeadlineTrial(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
                const Setting& setting)
      : scene_(scene),
        model_(model),
        setting_(setting),
        known_(model->links.size(), true),
        ingest_(test::whole_cloud(false)) {
    config_.tolerance = setting.tolerance;
    frame_ = scene.image(setting.points, setting.noise, &rng_);
    ingest();
  }

  // Full query and stopped queries go along the motion side by side, each with what it proved
  // itself.
  void motion(std::vector<Stopped>* all) {
    ProximityQuery full(model_, config_);
    std::vector<ProximityQuery> queries;
    for (std::size_t i = 0; i < all->size(); ++i) queries.emplace_back(model_, config_);
    full.run(scene_.poses(0.0), known_, {&snapshot_}, &truth_);
    for (ProximityQuery& query : queries) {
      query.run(scene_.poses(0.0), known_, {&snapshot_}, &results_);
    }
    double spent = 0.0;
    for (std::size_t k = 1; k <= setting_.steps && (k == 1 || spent < setting_.budget); ++k) {
      const Poses X_FL = scene_.poses(kPeriod * static_cast<double>(k));
      const double full_us = run(&full, X_FL, &truth_);
      spent += 1e-6 * full_us * (1.0 + static_cast<double>(all->size()));
      for (std::size_t i = 0; i < all->size(); ++i) stop(&queries[i], X_FL, full_us, &(*all)[i]);
    }
  }

  // The first queries after an image. What each knows then it has proven without a deadline.
  void new_image(std::vector<Stopped>* all) {
    ProximityQuery full(model_, config_);
    std::vector<ProximityQuery> queries;
    for (std::size_t i = 0; i < all->size(); ++i) queries.emplace_back(model_, config_);
    double spent = 0.0;
    for (std::size_t i = 1; i <= setting_.images && (i == 1 || spent < setting_.budget); ++i) {
      const double time = kPeriod * static_cast<double>(i * setting_.steps / setting_.images);
      const Poses last = scene_.poses(time - kPeriod), X_FL = scene_.poses(time);
      full.run(last, known_, {&snapshot_}, &truth_);
      for (ProximityQuery& query : queries) {
        query.set_config(config_);
        query.run(last, known_, {&snapshot_}, &results_);
      }
      snapshot_ = CloudSnapshot();  // its points may be read from the frame until then
      frame_ = scene_.image(setting_.points, setting_.noise, &rng_);
      ingest();
      const double full_us = run(&full, X_FL, &truth_);
      spent += 1e-6 * full_us * (1.0 + static_cast<double>(all->size()));
      for (std::size_t k = 0; k < all->size(); ++k) {
        ingest();
        stop(&queries[k], X_FL, full_us, &(*all)[k]);
      }
    }
  }

  // Each query reads the cloud anew, because the first query that looks at a tile loads it.
  void cold(std::vector<Stopped>* all) {
    double spent = 0.0;
    for (std::size_t i = 0; i < setting_.cold && (i == 0 || spent < setting_.budget); ++i) {
      const std::size_t step = i * setting_.steps / setting_.cold;
      const Poses X_FL = scene_.poses(kPeriod * static_cast<double>(step));
      ingest();
      ProximityQuery full(model_, config_);
      const double full_us = run(&full, X_FL, &truth_);
      spent += 1e-6 * full_us * (1.0 + static_cast<double>(all->size()));
      for (Stopped& stopped : *all) {
        ingest();
        ProximityQuery query(model_, config_);
        stop(&query, X_FL, full_us, &stopped);
      }
    }
  }

 private:
  void ingest() {
    snapshot_ = CloudSnapshot();
    ingest_.run(frame_.raw(), frame_.X_FS, {}, 0.0, &snapshot_);
  }

  double run(ProximityQuery* query, const Poses& X_FL, std::vector<LinkProximity>* results) {
    ThreadTimer timer;
    query->run(X_FL, known_, {&snapshot_}, results);
    return timer.lap();
  }

  void stop(ProximityQuery* query, const Poses& X_FL, double full_us, Stopped* out) {
    QueryConfig config = config_;
    config.deadline = 1e-6 * out->share * full_us;
    query->set_config(config);
    ThreadTimer timer;
    const bool is_complete = query->run(X_FL, known_, {&snapshot_}, &results_);
    const double us = timer.lap();
    ++out->queries;
    out->stopped += is_complete ? 0 : 1;
    out->full_us.push_back(full_us);
    out->overrun_us.push_back(is_complete ? 0.0 : std::max(0.0, us - out->share * full_us));
    for (std::size_t i = 0; i < results_.size(); ++i) count(results_[i], truth_[i], out);
  }

  void count(const LinkProximity& answer, const LinkProximity& truth, Stopped* out) const {
    ++out->links;
    const bool is_free = truth.state != LinkState::kContact;
    out->free_links += is_free ? 1 : 0;
    if (answer.state == LinkState::kUnknown) {
      ++out->unknown;
      out->width.push_back(std::numeric_limits<double>::infinity());
      return;
    }
    out->proven_free += is_free && answer.lower_bound > 0.0 ? 1 : 0;
    out->width.push_back(answer.state == LinkState::kClear ? 0.0
                                                           : answer.distance - answer.lower_bound);
    const bool holds = answer.lower_bound <= truth.distance + kRounding &&
                       answer.distance >= truth.lower_bound - kRounding;
    out->wrong += holds ? 0 : 1;
  }

  const HardScene& scene_;
  std::shared_ptr<const RobotModel> model_;
  Setting setting_;
  QueryConfig config_;
  std::vector<bool> known_;
  std::mt19937_64 rng_{1};
  Frame frame_;
  Ingest ingest_;
  CloudSnapshot snapshot_;
  std::vector<LinkProximity> truth_, results_;
};

}  // namespace

std::vector<Stopped> measure_deadlines(const HardScene& scene,
                                       const std::shared_ptr<const RobotModel>& model,
                                       const Setting& setting, const std::vector<double>& shares) {
  DeadlineTrial trial(scene, model, setting);
  std::vector<Stopped> all;
  for (const Asked asked : {Asked::kWarm, Asked::kNewImage, Asked::kCold}) {
    std::vector<Stopped> some(shares.size());
    for (std::size_t i = 0; i < shares.size(); ++i) {
      some[i].share = shares[i];
      some[i].asked = asked;
    }
    if (asked == Asked::kWarm) trial.motion(&some);
    if (asked == Asked::kNewImage) trial.new_image(&some);
    if (asked == Asked::kCold) trial.cold(&some);
    for (Stopped& stopped : some) all.push_back(std::move(stopped));
  }
  return all;
}

}  // namespace ist::benchmark
