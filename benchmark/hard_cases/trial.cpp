#include "hard_cases/trial.h"

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

// Compares a stopped query's answer with the whole one.
void count(const LinkProximity& answer, const LinkProximity& whole, Stopped* out) {
  ++out->links;
  const bool is_free = whole.state != LinkState::kContact;
  out->free_links += is_free ? 1 : 0;
  if (answer.state == LinkState::kUnknown) {
    ++out->unknown;
    out->width.push_back(std::numeric_limits<double>::infinity());
    return;
  }
  out->proven_free += is_free && answer.lower_bound > 0.0 ? 1 : 0;
  const bool is_clear = answer.state == LinkState::kClear;
  out->width.push_back(is_clear ? 0.0 : answer.distance - answer.lower_bound);
  const bool holds = answer.lower_bound <= whole.distance + kRounding &&
                     answer.distance >= whole.lower_bound - kRounding;
  out->wrong += holds ? 0 : 1;
}

// One scene while it is measured: its image, the whole query, and those that are stopped.
class Trial {
 public:
  Trial(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
        const Setting& setting, Measured* out)
      : scene_(scene),
        model_(model),
        setting_(setting),
        known_(model->links.size(), true),
        ingest_(test::whole_cloud(false)),
        out_(out) {
    config_.tolerance = setting.tolerance;
    config_.max_distance = setting.max_distance;
    for (Times& times : out->times) times.stopped.resize(setting.shares.size());
    next_image();
  }

  // Cold queries, spread over the motion.
  void cold() {
    spent_ = 0.0;
    for (std::size_t i = 0; i < setting_.cold && !is_over(i); ++i) {
      if (i > 0) next_image();
      forget();
      ask(kCold, pose(i * setting_.steps / setting_.cold));
    }
  }

  void motion() {
    spent_ = 0.0;
    forget();
    prove(pose(0));
    const std::size_t every = setting_.steps / std::max<std::size_t>(1, setting_.checks);
    for (std::size_t k = 1; k <= setting_.steps && !is_over(k - 1); ++k) {
      ask(kWarm, pose(k));
      if (setting_.checks > 0 && k % std::max<std::size_t>(1, every) == 0) {
        check_answers(scene_, *model_, frame_, pose(k), config_, whole_, &rng_, &out_->checked);
      }
    }
  }

  // New images, spread over the motion. The steps between are left out but for the last ones, from
  // which the image's first query starts.
  void images() {
    spent_ = 0.0;
    forget();
    for (std::size_t i = 1; i <= setting_.images && !is_over(i - 1); ++i) {
      const std::size_t k = i * setting_.steps / setting_.images;
      prove(pose(k - std::min<std::size_t>(k, 2)));
      prove(pose(k - std::min<std::size_t>(k, 1)));
      next_image();
      ask(kNewImage, pose(k));
    }
  }

 private:
  Poses pose(std::size_t step) const { return scene_.poses(kPeriod * static_cast<double>(step)); }

  bool is_over(std::size_t done) const { return done > 0 && spent_ > setting_.budget; }

  void next_image() {
    snapshot_ = CloudSnapshot();  // its points may be read from the frame until then
    frame_ = scene_.image(setting_.points, setting_.noise, &rng_);
    ingest();
  }
  void ingest() {
    snapshot_ = CloudSnapshot();
    ingest_.run(frame_.raw(), frame_.X_FS, {}, 0.0, &snapshot_);
  }

  // The whole query is the first one.
  void forget() {
    queries_.clear();
    for (std::size_t i = 0; i <= setting_.shares.size(); ++i)
      queries_.emplace_back(model_, config_);
  }
  void prove(const Poses& X_FL) {
    for (ProximityQuery& query : queries_) {
      query.set_config(config_);
      query.run(X_FL, known_, {&snapshot_}, &answers_);
    }
  }

  void ask(Asked asked, const Poses& X_FL) {
    Times& times = out_->times[asked];
    ThreadTimer timer;
    queries_.front().run(X_FL, known_, {&snapshot_}, &whole_);
    const double us = timer.lap();
    times.us.push_back(us);
    spent_ += 1e-6 * us * static_cast<double>(queries_.size());
    for (std::size_t i = 0; i < setting_.shares.size(); ++i) {
      if (asked != kWarm) ingest();  // the first query that looks at a tile loads it
      stop(&queries_[i + 1], X_FL, setting_.shares[i] * us, &times.stopped[i]);
    }
  }

  void stop(ProximityQuery* query, const Poses& X_FL, double deadline_us, Stopped* out) {
    QueryConfig config = config_;
    config.deadline = 1e-6 * deadline_us;
    query->set_config(config);
    ThreadTimer timer;
    const bool is_complete = query->run(X_FL, known_, {&snapshot_}, &answers_);
    const double us = timer.lap();
    ++out->queries;
    out->stopped += is_complete ? 0 : 1;
    out->overrun_us.push_back(is_complete ? 0.0 : std::max(0.0, us - deadline_us));
    for (std::size_t i = 0; i < answers_.size(); ++i) count(answers_[i], whole_[i], out);
  }

  const HardScene& scene_;
  std::shared_ptr<const RobotModel> model_;
  const Setting& setting_;
  QueryConfig config_;
  std::vector<bool> known_;
  std::mt19937_64 rng_{1};
  Frame frame_;
  Ingest ingest_;
  CloudSnapshot snapshot_;
  std::vector<ProximityQuery> queries_;
  std::vector<LinkProximity> whole_, answers_;
  Measured* out_;
  double spent_ = 0.0;  // [s] in the kind that is measured now
};

}  // namespace

void measure(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
             const Setting& setting, Measured* measured) {
  Trial trial(scene, model, setting, measured);
  trial.cold();
  trial.motion();
  trial.images();
}

}  // namespace ist::benchmark
