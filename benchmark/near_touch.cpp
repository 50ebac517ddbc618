// Queries by the distance of the nearest link: far, near, touching, and in contact. Recorded
// motions of the Panda, and a motion of the demo arm, among three Kinect frames; each step is
// raised or lowered so that the nearest link has the wanted distance.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Prints the tables of doc/benchmark.md
// and writes CSV.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "hard_cases/check.h"
#include "hard_cases/measure.h"
#include "ist_proximity/cloud/ingest.h"
#include "near_touch/motions.h"
#include "peers/scene.h"
#include "support.h"
#include "support/whole_cloud.h"

namespace {

using ist::CloudSnapshot;
using ist::ProximityQuery;
using ist::benchmark::Asked;
using ist::benchmark::Checked;
using ist::benchmark::Frame;
using ist::benchmark::HardScene;
using ist::benchmark::kAllAsked;
using ist::benchmark::MovingRobot;
using ist::benchmark::next_image;
using ist::benchmark::Poses;
using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

struct Options {
  std::vector<double> distances_mm{300, 50, 20, 5, 2, 0.5, -1, -5, -50};
  std::vector<double> tolerance_mm{1.0, 0.0};
  std::vector<std::string> robots;
  std::size_t parts = 12;
  std::size_t steps = 33;
  double noise = ist::benchmark::kKinectNoise;
  double max_error_mm = 1e3 * ist::PackingConfig().max_error;
  bool check = true;
  std::string csv, cache;
};

// Times [us] by how a query came about.
struct Class {
  std::vector<double> us[std::size(kAllAsked)];
  std::vector<double> evaluations;  // of warm queries
  std::size_t parts = 0;
  Checked checked;

  std::vector<double>& of(Asked asked) { return us[static_cast<std::size_t>(asked)]; }
};

// One part of a motion: a first query that nothing is known for (cold), a motion, and two new
// images at its end.
class Part {
 public:
  Part(const std::shared_ptr<const ist::RobotModel>& model, const ist::QueryConfig& config,
       const Frame& frame, Class* out)
      : model_(model),
        config_(config),
        query_(model, config),
        known_(model->links.size(), true),
        frame_(frame),
        out_(out) {
    ingest(frame);
  }

  void run(const std::vector<Poses>& motion, const Options& options, std::mt19937_64* rng) {
    ++out_->parts;
    time(motion.front(), Asked::kCold);
    ask(motion[1]);
    const std::size_t images = 1;  // steps that are left for the new image
    for (std::size_t k = 2; k + images < motion.size(); ++k) time(motion[k], Asked::kWarm);
    time(motion[motion.size() - 1 - images], Asked::kAgain);
    ingest(next_image(frame_, options.noise, rng));
    time(motion.back(), Asked::kNewImage);
    ingest(next_image(frame_, options.noise, rng));
    time(motion.back(), Asked::kStillNewImage);
  }

  // The answers to the last query, by brute force.
  void check(const MovingRobot& robot, const Poses& X_FL, std::mt19937_64* rng) {
    HardScene scene;
    scene.name = robot.name;
    scene.robot = robot.robot;
    check_answers(scene, *model_, image_, X_FL, config_, true, results_, rng, &out_->checked);
  }

 private:
  void ingest(const Frame& frame) {
    snapshot_ = CloudSnapshot();
    image_ = frame;
    ist::Ingest(ist::test::whole_cloud(false)).run(image_.raw(), image_.X_FS, {}, 0.0, &snapshot_);
  }

  void ask(const Poses& X_FL) { query_.run(X_FL, known_, {&snapshot_}, &results_); }

  void time(const Poses& X_FL, Asked asked) {
    ThreadTimer timer;
    ask(X_FL);
    out_->of(asked).push_back(timer.lap());
    if (asked == Asked::kWarm) {
      out_->evaluations.push_back(static_cast<double>(query_.statistics().exact_evaluations));
    }
  }

  std::shared_ptr<const ist::RobotModel> model_;
  ist::QueryConfig config_;
  ProximityQuery query_;
  std::vector<bool> known_;
  Frame frame_, image_;
  CloudSnapshot snapshot_;
  std::vector<ist::LinkProximity> results_;
  Class* out_;
};

// By tolerance: what was measured with the nearest link at `distance` [m].
std::vector<Class> measure(const MovingRobot& robot,
                           const std::shared_ptr<const ist::RobotModel>& model, double distance,
                           const std::vector<ist::benchmark::Scene>& scenes,
                           const Options& options) {
  constexpr std::size_t kLeastSteps = 8;  // parts that end sooner are left out
  std::vector<Class> classes(options.tolerance_mm.size());
  std::mt19937_64 rng(1);
  for (const ist::benchmark::Scene& scene : scenes) {
    CloudSnapshot cloud;
    ist::Ingest(ist::test::whole_cloud(false))
        .run(scene.frame.raw(), scene.frame.X_FS, {}, 0.0, &cloud);
    for (std::size_t part = 0; part < options.parts; ++part) {
      std::vector<Poses> motion = robot.part(part);
      motion.resize(std::min(motion.size(), options.steps + 3));
      motion = ist::benchmark::kept_at(distance, motion, model, cloud);
      if (motion.size() < kLeastSteps) continue;
      for (std::size_t t = 0; t < classes.size(); ++t) {
        ist::QueryConfig config;
        config.tolerance = 1e-3 * options.tolerance_mm[t];
        Part one(model, config, scene.frame, &classes[t]);
        one.run(motion, options, &rng);
        if (options.check && part == 0) one.check(robot, motion.back(), &rng);
      }
    }
  }
  return classes;
}

void print_header(std::FILE* csv) {
  if (csv == nullptr) return;
  std::fprintf(csv,
               "robot,tolerance_mm,max_error_mm,distance_mm,asked,parts,queries,median_us,"
               "p99_us,max_us,evaluations,checked,wrong\n");
}

void print(std::FILE* csv, const std::string& robot, double tolerance_mm, double max_error_mm,
           double distance_mm, Class* c) {
  for (const Asked asked : kAllAsked) {
    const std::vector<double>& us = c->of(asked);
    if (us.empty() || csv == nullptr) continue;
    std::fprintf(csv, "\"%s\",%g,%g,%g,\"%s\",%zu,%zu,%.2f,%.2f,%.2f,%.0f,%zu,%zu\n", robot.c_str(),
                 tolerance_mm, max_error_mm, distance_mm, name_of(asked), c->parts, us.size(),
                 quantile(us, 0.5), quantile(us, 0.99), quantile(us, 1.0),
                 quantile(c->evaluations, 0.5), c->checked.answers, c->checked.wrong);
  }
  if (csv != nullptr) std::fflush(csv);
  const std::vector<double>& warm = c->of(Asked::kWarm);
  if (warm.empty()) {
    std::printf("%s: no part of the motion gets to %g mm\n", robot.c_str(), distance_mm);
    return;
  }
  std::printf(
      "| %s | %g | %g | %zu | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %zu of %zu |\n",
      robot.c_str(), tolerance_mm, distance_mm, warm.size(), quantile(warm, 0.5),
      quantile(warm, 0.99), quantile(warm, 1.0), quantile(c->of(Asked::kAgain), 0.5),
      quantile(c->of(Asked::kNewImage), 0.5), quantile(c->of(Asked::kStillNewImage), 0.5),
      quantile(c->of(Asked::kCold), 0.5), c->checked.wrong, c->checked.answers);
  std::fflush(stdout);
}

// Returns whether every answer was right.
bool run(const Options& options, std::FILE* csv) {
  print_header(csv);
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const ist::benchmark::DataSet set = ist::benchmark::kinect_data(data, options.cache);
  std::vector<MovingRobot> robots = ist::benchmark::pandas(data);
  for (MovingRobot& robot : ist::benchmark::demo_arms()) robots.push_back(std::move(robot));
  bool all_right = true;
  std::printf(
      "| robot | tolerance [mm] | nearest link [mm] | queries | median [µs] | p99 | largest | "
      "same pose again | new image | new image, still | cold | wrong |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const MovingRobot& robot : robots) {
    const auto& words = options.robots;
    if (!words.empty() && std::none_of(words.begin(), words.end(), [&](const std::string& word) {
          return robot.name.find(word) != std::string::npos;
        })) {
      continue;
    }
    const auto model =
        ist::benchmark::packed(robot.robot, options.cache, 1e-3 * options.max_error_mm);
    for (const double distance_mm : options.distances_mm) {
      std::vector<Class> classes = measure(robot, model, 1e-3 * distance_mm, set.scenes, options);
      for (std::size_t t = 0; t < classes.size(); ++t) {
        print(csv, robot.name, options.tolerance_mm[t], options.max_error_mm, distance_mm,
              &classes[t]);
        all_right = all_right && classes[t].checked.wrong == 0;
      }
    }
  }
  return all_right;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Queries by the distance of the nearest link, on motions among Kinect frames.");
  app.option_defaults()->always_capture_default();
  app.add_option("--robot", options.robots,
                 "Robots whose names contain one of these words: visual, collision, demo")
      ->delimiter(',');
  app.add_option("--distance", options.distances_mm, "Of the nearest link [mm]; negative: inside")
      ->delimiter(',');
  app.add_option("--tolerance", options.tolerance_mm, "Of the queries [mm]")->delimiter(',');
  app.add_option("--parts", options.parts, "Parts of the motion, for each frame and distance");
  app.add_option("--steps", options.steps, "Of each part, 1 ms apart; at most 47");
  app.add_option("--noise", options.noise, "Of a new image [1/m]");
  app.add_option("--max-error", options.max_error_mm, "Of the packing [mm]");
  app.add_option("--check", options.check, "Check answers by brute force");
  app.add_option("--csv", options.csv, "File for all numbers");
  app.add_option("--cache", options.cache, "Folder that keeps packings");
  CLI11_PARSE(app, argc, argv);
  std::FILE* csv = nullptr;
  if (!options.csv.empty() && (csv = std::fopen(options.csv.c_str(), "w")) == nullptr) {
    std::perror(options.csv.c_str());
    return 2;
  }
  const bool all_right = run(options, csv);
  if (csv != nullptr) std::fclose(csv);
  return all_right ? 0 : 1;
}
