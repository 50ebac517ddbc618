// One task for all libraries: the minimum distance from each link of a robot to a depth image, and
// its witness points. Ours is compared with the alternatives, as CSV.
//
// One thread, processor time of that thread. Every answer is checked against the exact truth before
// anything is timed. Data: a synthetic scene, and the test data where they are (IST_PROXIMITY_DATA,
// or ../shared/data). scripts/benchmark calls it.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "peers/method.h"
#include "support.h"

namespace ist::benchmark {
namespace {

constexpr double kBudget = 2e6;            // [us] for the repetitions of one method on one scene
constexpr std::size_t kFrameQueries = 33;  // at 1 kHz, between two images at 30 Hz

/// Measurements of one method on one data set. "free" is without contact.
struct Result {
  std::vector<double> ingest, query, free_query, motion, frame, first;  // [us]
  std::vector<double> error;                                            // [m] without contact
  std::size_t failures = 0, answers = 0;
};

// A method on one scene of a data set.
class Trial {
 public:
  Trial(const DataSet& set, const Scene& scene, Method* method, Result* result)
      : set_(set),
        scene_(scene),
        method_(method),
        result_(result),
        answers_(set.robot.meshes.size()) {}

  void run() {
    time_ingest();
    for (const Configuration& truth : scene_.configurations) check(truth);
    time_queries();
    time_frames();
  }

 private:
  double query(const Poses& X_FL) {
    ThreadTimer timer;
    method_->query(X_FL, &answers_);
    return timer.lap();
  }

  // Repeats the ingest for a median, at least three times.
  void time_ingest() {
    method_->ingest(scene_.frame);  // warm
    double sum = 0.0;
    for (int i = 0; i < 30 && (i < 3 || sum < kBudget); ++i) {
      ThreadTimer timer;
      method_->ingest(scene_.frame);
      result_->ingest.push_back(timer.lap());
      sum += result_->ingest.back();
    }
  }

  void check(const Configuration& truth) {
    query(truth.X_FL);
    for (std::size_t i = 0; i < answers_.size(); ++i) {
      const Answer& answer = answers_[i];
      const double error = answer.distance - truth.distance[i];
      ++result_->answers;
      if (!truth.is_contact[i]) result_->error.push_back(error);
      if (truth.is_contact[i] && !method_->is_unsigned) continue;
      const double apart = (answer.p_FCl - answer.p_FCo).norm();
      const bool fits = std::abs(apart - std::abs(answer.distance)) <= method_->witness_error ||
                        std::isinf(method_->witness_error);
      if (fits && error >= method_->least_error && error <= method_->largest_error) continue;
      if (result_->failures++ > 0) continue;
      std::fprintf(stderr, "%s, %s, link %zu: %.6f m, truth %.6f m, witnesses %.6f m apart\n",
                   method_->name.c_str(), scene_.name.c_str(), i, answer.distance,
                   truth.distance[i], apart);
    }
  }

  void time_queries() {
    for (const Configuration& truth : scene_.configurations) {
      const double us = query(truth.X_FL);
      result_->query.push_back(us);
      const auto& contact = truth.is_contact;
      if (std::count(contact.begin(), contact.end(), true) == 0) result_->free_query.push_back(us);
    }
  }

  // All the work from one image to the next, for as many parts of the motion as the budget allows:
  // an ingest and the queries that follow. The images of the still scene have noise of their own:
  // the same image again would spare methods that keep something what no sensor spares them.
  void time_frames() {
    std::mt19937_64 rng(1);
    std::vector<Frame> images;
    for (int i = 0; i < 4; ++i) images.push_back(next_image(scene_.frame, kKinectNoise, &rng));
    const double one =
        quantile(result_->ingest, 0.5) + quantile(result_->query, 0.5) * kFrameQueries;
    const std::size_t count = set_.motion.size() / kFrameQueries;
    const auto affordable = static_cast<std::size_t>(std::max(1.0, kBudget / one));
    const std::size_t step = std::max<std::size_t>(1, count / affordable);
    for (std::size_t i = 0; i < count; i += step) {
      ThreadTimer timer;
      method_->ingest(images[i / step % images.size()]);
      double sum = timer.lap();
      for (std::size_t k = 0; k < kFrameQueries; ++k) {
        const double us = query(set_.motion[i * kFrameQueries + k]);
        (k == 0 ? result_->first : result_->motion).push_back(us);
        sum += us;
      }
      result_->frame.push_back(sum);
    }
  }

  const DataSet& set_;
  const Scene& scene_;
  Method* method_;
  Result* result_;
  std::vector<Answer> answers_;
};

void write(const std::string& data, const Method& method, const Result& r, CsvFile* csv) {
  csv->add("data", data)
      .add("method", method.name)
      .add("kind", method.kind)
      .add("spheres", method.spheres)
      .add("max_error_mm", 1e3 * method.max_error)
      .add("tolerance_mm", 1e3 * method.tolerance)
      .add("configurations", r.query.size())
      .add("answers", r.answers)
      .add("failures", r.failures)
      .add("error_least_mm", 1e3 * quantile(r.error, 0.0))
      .add("error_largest_mm", 1e3 * quantile(r.error, 1.0))
      .add("motion_queries", r.motion.size())
      .add("frames", r.frame.size());
  const std::vector<std::pair<std::string, const std::vector<double>*>> times = {
      {"ingest", &r.ingest}, {"query", &r.query}, {"free_query", &r.free_query},
      {"motion", &r.motion}, {"frame", &r.frame}, {"first", &r.first}};
  for (const auto& [name, us] : times) {
    csv->add(name + "_us", quantile(*us, 0.5))
        .add(name + "_p99_us", quantile(*us, 0.99))
        .add(name + "_max_us", quantile(*us, 1.0));
  }
  csv->end_row();
}

Methods all_methods(const Robot& robot) {
  Methods methods;
  add_ours(robot, &methods);
#ifdef IST_BENCHMARK_NANOFLANN
  add_nanoflann(robot, &methods);
#endif
  add_signed_grid(robot, &methods);
#ifdef IST_BENCHMARK_EMBREE
  add_embree(robot, &methods);
#endif
#ifdef IST_BENCHMARK_FCL
  add_fcl(robot, &methods);
#endif
  return methods;
}

// Returns whether every answer was right.
bool run(const DataSet& set, const std::string& only, CsvFile* csv) {
  bool all_right = true;
  for (const auto& method : all_methods(set.robot)) {
    if (method->name.find(only) == std::string::npos) continue;
    std::fprintf(stderr, "%s: %s, max_error %g mm, tolerance %g mm\n", set.name.c_str(),
                 method->name.c_str(), 1e3 * method->max_error, 1e3 * method->tolerance);
    Result result;
    for (const Scene& scene : set.scenes) Trial(set, scene, method.get(), &result).run();
    if (result.failures > 0) {
      std::fprintf(stderr, "  %zu of %zu answers are WRONG\n", result.failures, result.answers);
      all_right = false;
    }
    write(set.name, *method, result, csv);
  }
  return all_right;
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  using namespace ist::benchmark;
  std::string path, cache, only;
  std::vector<std::string> names = {"synthetic", "kinect"};
  CommandLine line("Distances of links to a depth image, beside other libraries.");
  line.add_option("result", path, "CSV file")->required();
  line.add_option("cache", cache, "Folder that keeps packings")->required();
  line.add_option("data", names,
                  "What to measure with; recorded data that are not there are left out")
      ->check(CLI::IsMember({"synthetic", "kinect"}));
  line.add_option("--only", only, "Methods whose names contain this");
  line.read(argc, argv);
  CsvFile csv(path);
  const auto recorded = ist::test::data_dir();
  bool all_right = true;
  for (const std::string& name : names) {
    if (name == "synthetic") {
      all_right = run(synthetic_data(cache), only, &csv) && all_right;
    } else if (recorded) {
      all_right = run(kinect_data(*recorded, cache), only, &csv) && all_right;
    } else {
      std::fprintf(stderr, "kinect: %s\n", ist::test::kNoData.c_str());
      all_right = all_right && names.size() > 1;  // nothing was measured
    }
  }
  return all_right ? 0 : 1;
}
