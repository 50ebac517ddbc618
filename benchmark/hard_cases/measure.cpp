#include "hard_cases/measure.h"

#include <algorithm>
#include <limits>
#include <random>
#include <utility>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

constexpr double kPeriod = 0.001;           // [s] between two queries
constexpr std::size_t kAgainEvery = 8;      // steps of the motion after which a pose is asked again
constexpr std::size_t kStepsPerImage = 33;  // at 30 Hz

// One scene while it is measured: the images and the times so far.
class Trial {
 public:
  Trial(const HardScene& scene, std::shared_ptr<const RobotModel> model, const Setting& setting)
      : scene_(scene),
        model_(std::move(model)),
        setting_(setting),
        known_(model_->links.size(), true),
        ingest_(test::whole_cloud(false)) {
    config_.tolerance = setting.tolerance;
    for (const Asked asked : kAllAsked) {
      measured_.times.emplace_back();
      measured_.times.back().asked = asked;
    }
    next_image();
  }

  Measured run() {
    motion();
    images(Asked::kNewImage);
    images(Asked::kStillNewImage);
    cold();
    return std::move(measured_);
  }

 private:
  void next_image() {
    snapshot_ = CloudSnapshot();  // its points may be read from the frame until then
    frame_ = scene_.image(setting_.points, setting_.noise, &rng_);
    ingest_.run(frame_.raw(), frame_.X_FS, {}, 0.0, &snapshot_);
  }

  void ask(ProximityQuery* query, const Poses& X_FL) {
    query->run(X_FL, known_, {&snapshot_}, &results_);
  }

  Times& times(Asked asked) { return measured_.times[static_cast<std::size_t>(asked)]; }

  void time(ProximityQuery* query, const Poses& X_FL, Asked asked) {
    ThreadTimer timer;
    ask(query, X_FL);
    const double us = timer.lap();
    Times& all = times(asked);
    all.us.push_back(us);
    all.evaluations.push_back(static_cast<double>(query->statistics().exact_evaluations));
    double nearest = std::numeric_limits<double>::infinity();
    for (const LinkProximity& link : results_) {
      if (link.state >= LinkState::kNear) nearest = std::min(nearest, link.distance);
    }
    all.nearest.push_back(nearest);
    spent_ += 1e-6 * us;
  }

  bool is_over() const { return spent_ > setting_.budget; }

  void check(const Poses& X_FL) {
    check_answers(scene_, *model_, frame_, X_FL, config_, true, results_, &rng_,
                  &measured_.checked);
  }

  void motion() {
    ProximityQuery query(model_, config_);
    ask(&query, scene_.poses(0.0));
    spent_ = 0.0;
    const std::size_t every = setting_.steps / std::max<std::size_t>(1, setting_.checks);
    for (std::size_t k = 1; k <= setting_.steps && (k == 1 || !is_over()); ++k) {
      const Poses X_FL = scene_.poses(kPeriod * static_cast<double>(k));
      time(&query, X_FL, Asked::kWarm);
      if (setting_.checks > 0 && k % std::max<std::size_t>(1, every) == 0) check(X_FL);
      if (k % kAgainEvery == 1) time(&query, X_FL, Asked::kAgain);
    }
  }

  // New images, one for each kStepsPerImage steps. The steps between are left out but for the last
  // one, from which the next image's first query starts.
  void images(Asked asked) {
    ProximityQuery query(model_, config_);
    const bool is_still = asked == Asked::kStillNewImage;
    spent_ = 0.0;
    for (std::size_t i = 1; i <= setting_.images && (i == 1 || !is_over()); ++i) {
      const double time_of_image =
          is_still ? 0.0 : kPeriod * static_cast<double>(i * kStepsPerImage);
      ask(&query, scene_.poses(is_still ? 0.0 : time_of_image - 2.0 * kPeriod));
      ask(&query, scene_.poses(is_still ? 0.0 : time_of_image - kPeriod));
      next_image();
      time(&query, scene_.poses(time_of_image), asked);
    }
  }

  // Spread over the motion.
  void cold() {
    spent_ = 0.0;
    for (std::size_t i = 0; i < setting_.cold && (i == 0 || !is_over()); ++i) {
      next_image();
      ProximityQuery query(model_, config_);
      const std::size_t step = i * setting_.steps / setting_.cold;
      const Poses X_FL = scene_.poses(kPeriod * static_cast<double>(step));
      time(&query, X_FL, Asked::kCold);
      if (i == 0 && setting_.checks > 0) check(X_FL);
    }
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
  std::vector<LinkProximity> results_;
  Measured measured_;
  double spent_ = 0.0;  // [s] in the kind that is measured now
};

}  // namespace

const char* name_of(Asked asked) {
  switch (asked) {
    case Asked::kWarm:
      return "warm";
    case Asked::kAgain:
      return "same pose again";
    case Asked::kNewImage:
      return "new image";
    case Asked::kStillNewImage:
      return "new image, still";
    case Asked::kCold:
      return "cold";
  }
  return "";
}

std::shared_ptr<const RobotModel> packed(const RobotDescription& robot,
                                         const std::string& cache_directory, double max_error) {
  RobotModelConfig config;
  config.distance_fields = true;  // as the node has them
  config.packing.max_error = max_error;
  config.cache_directory = cache_directory;
  return build_robot_model(robot, config);
}

Measured measure(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
                 const Setting& setting) {
  return Trial(scene, model, setting).run();
}

}  // namespace ist::benchmark
