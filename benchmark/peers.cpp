// One task for all libraries: the minimum distance from each link of a robot to a depth image, and
// its witness points. Ours is compared with the alternatives, as CSV.
//
// One thread, processor time of that thread. Every answer is checked against the exact truth before
// anything is timed. Data: a synthetic scene, and the test data if it is there (IST_PROXIMITY_DATA,
// or ../shared/data).
//
// Usage: peers RESULT.csv CACHE_FOLDER [synthetic|kinect]... [--only WORD]...; scripts/benchmark
// calls it. --only: methods whose names contain one of these words.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "peers/method.h"
#include "peers/result.h"
#include "support.h"
#include "support/data_dir.h"

namespace {

using ist::benchmark::Answer;
using ist::benchmark::Configuration;
using ist::benchmark::DataSet;
using ist::benchmark::Frame;
using ist::benchmark::Kind;
using ist::benchmark::Method;
using ist::benchmark::Methods;
using ist::benchmark::quantile;
using ist::benchmark::Result;
using ist::benchmark::Scene;
using ist::benchmark::ThreadTimer;

constexpr std::size_t kFewSpheres = 59;    // as many as a common hand-made set for this arm
constexpr double kBudget = 2e6;            // [us] for the repetitions of one method on one scene
constexpr std::size_t kFrameQueries = 33;  // at 1 kHz, between two images at 30 Hz

bool any_contact(const Configuration& configuration) {
  return std::find(configuration.is_contact.begin(), configuration.is_contact.end(), true) !=
         configuration.is_contact.end();
}

// Repeats the ingest for a median, at least three times.
void time_ingest(Method* method, const Scene& scene, Result* result) {
  method->ingest(scene.frame);  // warm
  ThreadTimer timer;
  double sum = 0.0;
  for (int i = 0; i < 30 && (i < 3 || sum < kBudget); ++i) {
    timer.lap();
    method->ingest(scene.frame);
    result->ingest.push_back(timer.lap());
    sum += result->ingest.back();
  }
}

void check(Method* method, const Scene& scene, Result* result) {
  std::vector<Answer> answers(scene.configurations.front().X_FL.size());
  for (std::size_t k = 0; k < scene.configurations.size(); ++k) {
    const Configuration& truth = scene.configurations[k];
    method->query(truth.X_FL, &answers);
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const bool contact = truth.is_contact[i];
      const double error = answers[i].distance - truth.distance[i];
      if (!contact) result->error.push_back(error);
      ++result->answers;
      const double apart = (answers[i].p_FCl - answers[i].p_FCo).norm();
      const bool fits = std::abs(apart - std::abs(answers[i].distance)) <= method->witness_error ||
                        std::isinf(method->witness_error);
      const bool holds = error >= method->least_error && error <= method->largest_error;
      if ((!contact || method->is_unsigned) && !(holds && fits)) {
        if (result->failures++ == 0) {
          std::fprintf(
              stderr,
              "%s, %s, configuration %zu, link %zu: %.6f m, truth %.6f m, witnesses %.6f m apart\n",
              method->name.c_str(), scene.name.c_str(), k, i, answers[i].distance,
              truth.distance[i], apart);
        }
      }
    }
  }
}

void time_queries(Method* method, const Scene& scene, Result* result) {
  std::vector<Answer> answers(scene.configurations.front().X_FL.size());
  ThreadTimer timer;
  for (std::size_t k = 0; k < scene.configurations.size(); ++k) {
    timer.lap();
    method->query(scene.configurations[k].X_FL, &answers);
    const double us = timer.lap();
    result->query.push_back(us);
    if (!any_contact(scene.configurations[k])) result->free_query.push_back(us);
  }
}

// The motion is divided into parts, one for each image. Returns the step through the parts that the
// budget allows: 1 if it allows all.
// @param one  [us] time of one part
std::size_t frame_step(const DataSet& set, double one) {
  const std::size_t frames = set.motion.size() / kFrameQueries;
  const auto affordable = static_cast<std::size_t>(std::max(1.0, kBudget / one));
  return std::max<std::size_t>(1, frames / affordable);
}

// Times the queries of the motion in one image.
void time_motion(Method* method, const DataSet& set, const std::vector<bool>& contact,
                 Result* result) {
  std::vector<Answer> answers(set.robot.meshes.size());
  const std::size_t frames = set.motion.size() / kFrameQueries;
  const double one = std::max(1.0, quantile(result->query, 0.5)) * kFrameQueries;
  const std::size_t step = frame_step(set, one);
  ThreadTimer timer;
  method->query(set.motion[0], &answers);
  for (std::size_t frame = 0; frame < frames; frame += step) {
    for (std::size_t k = frame * kFrameQueries; k < (frame + 1) * kFrameQueries; ++k) {
      timer.lap();
      method->query(set.motion[k], &answers);
      const double us = timer.lap();
      result->motion.push_back(us);
      if (!contact[k]) result->free_motion.push_back(us);
    }
  }
}

// Images of one still scene, each with noise of its own: the same image again would spare methods
// that keep something what no sensor spares them.
std::vector<Frame> images_of(const Scene& scene) {
  constexpr std::size_t kImages = 4;
  std::mt19937_64 rng(1);
  std::vector<Frame> images;
  for (std::size_t i = 0; i < kImages; ++i) {
    images.push_back(next_image(scene.frame, ist::benchmark::kKinectNoise, &rng));
  }
  return images;
}

// Times all the work from one image to the next: an ingest and the queries that follow.
// @param contact  by pose, without the noise
void time_frames(Method* method, const DataSet& set, const std::vector<Frame>& images,
                 const std::vector<bool>& contact, Result* result) {
  std::vector<Answer> answers(set.robot.meshes.size());
  const std::size_t frames = set.motion.size() / kFrameQueries;
  const double one = quantile(result->ingest, 0.5) + quantile(result->query, 0.5) * kFrameQueries;
  const std::size_t step = frame_step(set, one);
  ThreadTimer timer;
  for (std::size_t frame = 0; frame < frames; frame += step) {
    timer.lap();
    method->ingest(images[frame / step % images.size()]);
    double sum = timer.lap();
    bool is_free = true;
    for (std::size_t k = frame * kFrameQueries; k < (frame + 1) * kFrameQueries; ++k) {
      timer.lap();
      method->query(set.motion[k], &answers);
      const double us = timer.lap();
      if (k == frame * kFrameQueries) {
        result->first.push_back(us);
        if (!contact[k]) result->free_first.push_back(us);
      }
      sum += us;
      is_free = is_free && !contact[k];
    }
    result->frame.push_back(sum);
    if (is_free) result->free_frame.push_back(sum);
  }
}

// Whether each pose of the motion is in contact. Times are reported with and without contact.
std::vector<bool> contacts(const std::shared_ptr<const ist::RobotModel>& model, const DataSet& set,
                           const Scene& scene) {
  ist::IngestConfig config;
  config.self_filter = false;
  ist::CloudSnapshot snapshot;
  ist::Ingest(config).run(scene.frame.raw(), scene.frame.X_FS, {}, 0.0, &snapshot);
  ist::ProximityQuery query(model, {});
  const std::vector<bool> known(model->links.size(), true);
  std::vector<ist::LinkProximity> results;
  std::vector<bool> contact;
  for (const auto& X_FL : set.motion) {
    query.run(X_FL, known, {&snapshot}, &results);
    contact.push_back(std::any_of(results.begin(), results.end(), [](const auto& link) {
      return link.state == ist::LinkState::kContact;
    }));
  }
  return contact;
}

Methods all_methods(const DataSet& set) {
  Methods methods;
  const ist::benchmark::SphereSet spheres = few_spheres(set.robot, kFewSpheres);
  add_ours(set.robot, &methods);
#ifdef IST_BENCHMARK_NANOFLANN
  add_nanoflann(spheres, &methods);
#endif
  add_signed_grid(set.robot, &methods);
#ifdef IST_BENCHMARK_EMBREE
  add_embree(set.robot, &methods);
#endif
#ifdef IST_BENCHMARK_FCL
  add_fcl(set.robot, &methods);
#endif
  return methods;
}

// Returns whether every answer was right.
bool run(const DataSet& set, const std::vector<std::string>& words, std::FILE* csv) {
  const auto model = set.robot.pack(0.005);
  std::vector<std::vector<bool>> contact;
  std::vector<std::vector<Frame>> images;
  for (const Scene& scene : set.scenes) {
    contact.push_back(contacts(model, set, scene));
    images.push_back(images_of(scene));
  }
  bool all_right = true;
  for (const auto& method : all_methods(set)) {
    if (!words.empty() && std::none_of(words.begin(), words.end(), [&](const std::string& word) {
          return method->name.find(word) != std::string::npos;
        })) {
      continue;
    }
    std::fprintf(stderr, "%s: %s, max_error %g mm, tolerance %g mm\n", set.name.c_str(),
                 method->name.c_str(), 1e3 * method->max_error, 1e3 * method->tolerance);
    Result result;
    for (std::size_t s = 0; s < set.scenes.size(); ++s) {
      time_ingest(method.get(), set.scenes[s], &result);
      check(method.get(), set.scenes[s], &result);
      time_queries(method.get(), set.scenes[s], &result);
      time_motion(method.get(), set, contact[s], &result);
      time_frames(method.get(), set, images[s], contact[s], &result);
    }
    if (result.failures > 0) {
      std::fprintf(stderr, "  %zu of %zu answers are WRONG\n", result.failures, result.answers);
      all_right = false;
    }
    print(csv, set.name, *method, result);
  }
  return all_right;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr,
                 "Usage: peers RESULT.csv CACHE_FOLDER [synthetic|kinect]... [--only WORD]...\n");
    return 2;
  }
  std::vector<std::string> wanted, words;
  for (int i = 3; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--only" && i + 1 < argc) {
      words.emplace_back(argv[++i]);
    } else {
      wanted.push_back(argument);
    }
  }
  if (wanted.empty()) wanted = {"synthetic", "kinect"};
  std::FILE* csv = std::fopen(argv[1], "w");
  if (csv == nullptr) {
    std::fprintf(stderr, "cannot write %s\n", argv[1]);
    return 2;
  }
  ist::benchmark::print_header(csv);
  bool all_right = true;
  for (const std::string& name : wanted) {
    const auto data = ist::test::data_dir();
    if (name == "kinect" && !data) {
      std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
    } else if (name == "kinect") {
      all_right = run(ist::benchmark::kinect_data(*data, argv[2]), words, csv) && all_right;
    } else {
      all_right = run(ist::benchmark::synthetic_data(argv[2]), words, csv) && all_right;
    }
  }
  std::fclose(csv);
  return all_right ? 0 : 1;
}
