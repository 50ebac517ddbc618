// Cost of the kinds of query, as Markdown tables: every link, the robot's minimum, one link. The
// motion is sampled at 1 kHz among the test data's depth images (IST_PROXIMITY_DATA, or
// ../shared/data), or in the synthetic scene without them.
//
// Usage: modes CACHE_FOLDER; scripts/benchmark calls it.

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "peers/scene.h"
#include "support.h"
#include "support/data_dir.h"
#include "support/whole_cloud.h"

namespace {

using ist::CloudSnapshot;
using ist::LinkProximity;
using ist::LinkState;
using ist::ProximityQuery;
using ist::QueryConfig;
using ist::benchmark::DataSet;
using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;
using Poses = std::vector<Eigen::Isometry3d>;

constexpr double kMaxError = 0.002;  // [m] packing

QueryConfig query_config(double tolerance, double relative = 0.0) {
  QueryConfig config;
  config.max_distance = 10.0;
  config.tolerance = tolerance;
  config.relative_tolerance = relative;
  return config;
}

struct Bench {
  explicit Bench(const std::string& cache) {
    const auto data = ist::test::data_dir();
    set = data ? ist::benchmark::kinect_data(*data, cache) : ist::benchmark::synthetic_data(cache);
    model = set.robot.pack(kMaxError);
    known.assign(model->links.size(), true);
    clouds.resize(set.scenes.size());
    for (std::size_t s = 0; s < clouds.size(); ++s) {
      const ist::benchmark::Frame& frame = set.scenes[s].frame;
      ist::Ingest(ist::test::whole_cloud(false)).run(frame.raw(), frame.X_FS, {}, 0.0, &clouds[s]);
    }
    find_free();
  }

  // Finds the part of the motion without contact, in which the kinds of query can be compared.
  void find_free() {
    ProximityQuery query(model, query_config(0.001));
    std::vector<LinkProximity> results;
    free.resize(clouds.size());
    for (std::size_t s = 0; s < clouds.size(); ++s) {
      for (const Poses& X_FL : set.motion) {
        query.run(X_FL, known, {&clouds[s]}, &results);
        const bool contact = std::any_of(results.begin(), results.end(), [](const auto& link) {
          return link.state == LinkState::kContact;
        });
        if (!contact) free[s].push_back(&X_FL);
      }
    }
  }

  // The times [us] of all free configurations; there is a new `ask` for each cloud.
  using Ask = std::function<void(const Poses&, const CloudSnapshot&)>;
  std::vector<double> time(const std::function<Ask()>& make) const {
    std::vector<double> us;
    for (std::size_t s = 0; s < clouds.size(); ++s) {
      const Ask ask = make();
      ThreadTimer timer;
      for (const Poses* X_FL : free[s]) {
        timer.lap();
        ask(*X_FL, clouds[s]);
        us.push_back(timer.lap());
      }
    }
    return us;
  }

  Ask every_link(const QueryConfig& config) const {
    auto query = std::make_shared<ProximityQuery>(model, config);
    auto results = std::make_shared<std::vector<LinkProximity>>();
    return [this, query, results](const Poses& X_FL, const CloudSnapshot& cloud) {
      query->run(X_FL, known, {&cloud}, results.get());
    };
  }

  Ask minimum(const QueryConfig& config) const {
    auto query = std::make_shared<ProximityQuery>(model, config);
    auto result = std::make_shared<ist::RobotProximity>();
    return [this, query, result](const Poses& X_FL, const CloudSnapshot& cloud) {
      query->run_minimum(X_FL, known, {&cloud}, result.get());
    };
  }

  Ask last_link(const QueryConfig& config) const {
    auto query = std::make_shared<ProximityQuery>(model, config);
    auto result = std::make_shared<LinkProximity>();
    return [query, result](const Poses& X_FL, const CloudSnapshot& cloud) {
      query->run_link(X_FL.size() - 1, X_FL.back(), {&cloud}, result.get());
    };
  }

  DataSet set;
  std::shared_ptr<const ist::RobotModel> model;
  std::vector<bool> known;
  std::vector<CloudSnapshot> clouds;
  std::vector<std::vector<const Poses*>> free;  // by cloud
};

void print_modes(const Bench& bench) {
  const auto all = [&](double tolerance, double relative = 0.0) {
    return bench.time([&] { return bench.every_link(query_config(tolerance, relative)); });
  };
  const auto minimum = [&](double tolerance) {
    return bench.time([&] { return bench.minimum(query_config(tolerance)); });
  };
  std::printf("# modes\n| asked for | median | p99 | all links / this |\n|---|---|---|---|\n");
  const auto exact = all(0.0), coarse = all(0.001);
  const auto print = [](const char* what, const std::vector<double>& us,
                        const std::vector<double>& reference) {
    std::printf("| %s | %.1f µs | %.0f µs | %.1f |\n", what, quantile(us, 0.5), quantile(us, 0.99),
                quantile(reference, 0.5) / quantile(us, 0.5));
  };
  print("all links, exact", exact, exact);
  print("all links, to 1 mm", coarse, coarse);
  print("all links, to 1 mm or 5 %", all(0.001, 0.05), coarse);
  print("the robot's minimum, exact", minimum(0.0), exact);
  print("the robot's minimum, to 1 mm", minimum(0.001), coarse);
  print("the last link alone, to 1 mm",
        bench.time([&] { return bench.last_link(query_config(0.001)); }), coarse);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "Usage: modes CACHE_FOLDER\n");
    return 2;
  }
  const Bench bench(argv[1]);
  print_modes(bench);
  return 0;
}
