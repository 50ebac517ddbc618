// Queries where branch and bound has little to prune, as CSV files:
// - hard.csv, scenes of ties, near-ties, contact and enclosure: times on a motion at 1 kHz, of the
//   same pose asked again, of the first query after an image, and cold; answers against brute
//   force;
// - near.csv, by the distance of the nearest link: motions among Kinect frames, each step raised or
//   lowered so that the nearest link has that distance;
// - deadline.csv, the hard scenes again: what stopped queries know, and how late they are.

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "hard_cases/near.h"
#include "hard_cases/scene.h"
#include "hard_cases/trial.h"
#include "ist_proximity/cloud/ingest.h"
#include "support.h"
#include "support/data_dir.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

const double kMaxError = PackingConfig().max_error;  // [m]
constexpr std::array kTolerances = {0.001, 0.0};     // [m]
constexpr std::array kNoises = {0.0, 0.001};         // [m]
constexpr std::array kDistances = {0.3, 0.05, 0.02, 0.005, 0.002, 0.0005, -0.001, -0.005, -0.05};

struct Options {
  std::string folder, cache, only;
  double max_distance = QueryConfig().max_distance;  // [m]
  bool quick = false;
};

// The values that all rows of one kind of queries have.
CsvFile& add_times(const Times& times, std::size_t asked, CsvFile* csv) {
  return csv->add("asked", kAskedNames[asked])
      .add("queries", times.us.size())
      .add("median_us", quantile(times.us, 0.5))
      .add("p99_us", quantile(times.us, 0.99))
      .add("max_us", quantile(times.us, 1.0));
}

CsvFile& add_setting(const HardScene& scene, const Setting& setting, CsvFile* csv) {
  return csv->add("scene", scene.name)
      .add("link", scene.link)
      .add("points", setting.points)
      .add("noise_mm", 1e3 * setting.noise)
      .add("tolerance_mm", 1e3 * setting.tolerance)
      .add("max_error_mm", 1e3 * kMaxError);
}

void write_times(const HardScene& scene, const Setting& setting, const Measured& measured,
                 CsvFile* csv) {
  for (std::size_t asked = 0; asked < kAsked; ++asked) {
    if (measured.times[asked].us.empty()) continue;
    add_setting(scene, setting, csv);
    add_times(measured.times[asked], asked, csv)
        .add("checked", measured.checked.answers)
        .add("wrong", measured.checked.wrong)
        .add("largest_width_mm", 1e3 * measured.checked.largest_width)
        .end_row();
  }
}

// @returns the number of wrong bounds
std::size_t write_stopped(const HardScene& scene, const Setting& setting, const Measured& measured,
                          CsvFile* csv) {
  std::size_t wrong = 0;
  for (std::size_t asked = 0; asked < kAsked; ++asked) {
    const Times& times = measured.times[asked];
    for (std::size_t i = 0; i < setting.shares.size(); ++i) {
      const Stopped& s = times.stopped[i];
      wrong += s.wrong;
      add_setting(scene, setting, csv)
          .add("asked", kAskedNames[asked])
          .add("share", setting.shares[i])
          .add("queries", s.queries)
          .add("stopped", s.stopped)
          .add("full_us", quantile(times.us, 0.5))
          .add("links", s.links)
          .add("unknown", s.unknown)
          .add("free_links", s.free_links)
          .add("proven_free", s.proven_free)
          .add("width_mm", 1e3 * quantile(s.width, 0.5))
          .add("overrun_max_us", quantile(s.overrun_us, 1.0))
          .add("wrong", s.wrong)
          .end_row();
    }
  }
  return wrong;
}

Setting hard_setting(const Options& options) {
  Setting setting;
  setting.max_distance = options.max_distance;
  if (!options.quick) return setting;
  setting.steps = 50;
  setting.cold = setting.images = 3;
  setting.budget = 0.3;
  setting.checks = 1;
  return setting;
}

Setting deadline_setting(const Options& options) {
  const bool quick = options.quick;
  Setting setting;
  setting.max_distance = options.max_distance;
  setting.steps = quick ? 60 : 1000;
  setting.cold = quick ? 5 : 20;
  setting.images = quick ? 5 : 100;
  setting.budget = quick ? 0.5 : 20.0;
  setting.checks = 0;
  setting.shares = {0.05, 0.1, 0.25, 0.5, 0.75, 1.0};
  return setting;
}

/// @returns the number of wrong answers
std::size_t measure_scene(const HardScene& scene, const Options& options, CsvFile* hard,
                          CsvFile* deadline) {
  std::fprintf(stderr, "%s\n", scene.name.c_str());
  const auto model = packed(scene.robot, options.cache, kMaxError);
  std::size_t wrong = 0;
  for (const double noise : kNoises) {
    if (scene.is_recorded && noise > 0.0) continue;
    for (const double tolerance : kTolerances) {
      Setting setting = hard_setting(options);
      setting.noise = noise;
      setting.tolerance = tolerance;
      Measured measured;
      measure(scene, model, setting, &measured);
      write_times(scene, setting, measured, hard);
      wrong += measured.checked.wrong;
    }
    Setting setting = deadline_setting(options);
    setting.noise = noise;
    Measured measured;
    measure(scene, model, setting, &measured);
    wrong += write_stopped(scene, setting, measured, deadline);
  }
  return wrong;
}

// By tolerance: what is measured with the nearest link at `distance` [m], in all frames.
std::array<Measured, kTolerances.size()> measure_near(
    const MovingRobot& robot, const std::shared_ptr<const RobotModel>& model, double distance,
    const std::vector<Scene>& frames, const Options& options) {
  constexpr std::size_t kLeastSteps = 8, kMostSteps = 36;  // shorter parts are left out
  std::array<Measured, kTolerances.size()> all;
  for (const Scene& scene : frames) {
    CloudSnapshot cloud;
    Ingest(test::whole_cloud(false)).run(scene.frame.raw(), scene.frame.X_FS, {}, 0.0, &cloud);
    for (std::size_t part = 0; part < (options.quick ? 3 : 12); ++part) {
      std::vector<Poses> motion = robot.part(part);
      motion.resize(std::min(motion.size(), kMostSteps));
      motion = kept_at(distance, motion, model, cloud);
      if (motion.size() < kLeastSteps) continue;
      const auto poses = [motion](double time) {
        return motion[static_cast<std::size_t>(std::lround(1e3 * time))];
      };
      Setting setting;
      setting.max_distance = options.max_distance;
      setting.steps = motion.size() - 1;
      setting.cold = setting.images = 1;
      setting.checks = part == 0 ? 1 : 0;
      for (std::size_t t = 0; t < all.size(); ++t) {
        const HardScene one{scene.name, robot.name, robot.robot, images_after(scene.frame), poses};
        setting.tolerance = kTolerances[t];
        measure(one, model, setting, &all[t]);
      }
    }
  }
  return all;
}

/// @returns the number of wrong answers
std::size_t measure_near(const std::filesystem::path& data, const Options& options, CsvFile* csv) {
  const std::vector<Scene> frames = kinect_data(data, options.cache).scenes;
  std::size_t wrong = 0;
  for (const MovingRobot& robot : moving_robots(data)) {
    const auto model = packed(robot.robot, options.cache, kMaxError);
    for (const double distance : kDistances) {
      std::fprintf(stderr, "%s, nearest link at %g mm\n", robot.name.c_str(), 1e3 * distance);
      const auto measured = measure_near(robot, model, distance, frames, options);
      for (std::size_t t = 0; t < measured.size(); ++t) {
        wrong += measured[t].checked.wrong;
        for (std::size_t asked = 0; asked < kAsked; ++asked) {
          if (measured[t].times[asked].us.empty()) continue;
          csv->add("robot", robot.name)
              .add("tolerance_mm", 1e3 * kTolerances[t])
              .add("max_error_mm", 1e3 * kMaxError)
              .add("distance_mm", 1e3 * distance);
          add_times(measured[t].times[asked], asked, csv)
              .add("checked", measured[t].checked.answers)
              .add("wrong", measured[t].checked.wrong)
              .end_row();
        }
      }
    }
  }
  return wrong;
}

std::size_t run(const Options& options) {
  CsvFile hard(options.folder + "/hard.csv"), near(options.folder + "/near.csv"),
      deadline(options.folder + "/deadline.csv");
  std::vector<HardScene> scenes = hard_scenes();
  const auto data = test::data_dir();
  if (data) {
    for (const HardScene& scene : recorded_scenes(*data, options.cache)) scenes.push_back(scene);
  } else {
    std::fprintf(stderr, "%s\n", test::kNoData.c_str());
  }
  std::size_t wrong = 0;
  for (const HardScene& scene : scenes) {
    if (scene.name.find(options.only) == std::string::npos) continue;
    wrong += measure_scene(scene, options, &hard, &deadline);
  }
  if (data && options.only.empty()) wrong += measure_near(*data, options, &near);
  return wrong;
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ist::benchmark::Options options;
  ist::benchmark::CommandLine line("Queries in hard scenes, near and touching, and out of time.");
  line.add_option("folder", options.folder, "Where CSV files are written")->required();
  line.add_option("cache", options.cache, "Folder that keeps packings")->required();
  line.add_option("--max-distance", options.max_distance, "Of the queries [m]");
  line.add_flag("--quick", options.quick, "Fewer clouds and queries");
  line.add_option("--only", options.only, "A scene whose name contains this");
  line.read(argc, argv);
  return ist::benchmark::run(options) == 0 ? 0 : 1;
}
