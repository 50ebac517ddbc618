// Times of impact compared with dense sampling of exact distances: a table for doc/accuracy.md.
//
// Usage: time_of_impact CACHE_FOLDER [DOCUMENT]; scripts/benchmark --repulsion calls it. The
// Panda's motions need the test data: IST_PROXIMITY_DATA, or ../shared/data.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/link_poses.h"
#include "support.h"
#include "support/accuracy.h"
#include "support/data_dir.h"
#include "support/motions.h"
#include "support/npy.h"
#include "support/truth.h"

namespace {

using ist::benchmark::quantile;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr int kMotions = 1000, kPandaMotions = 200;

struct Tally {
  int motions = 0, contacts = 0, late = 0, close = 0, alarms = 0;
  std::vector<double> early, us, steps;  // [s] before the true contact; per motion

  void add(const std::vector<ist::ImpactTime>& found, double truth, double took) {
    double first = kInf, queries = 0.0;
    for (const ist::ImpactTime& one : found) {
      first = std::min(one.time, first);  // NaN counts as never
      queries += one.steps;
    }
    ++motions;
    us.push_back(took);
    steps.push_back(queries);
    late += first > truth ? 1 : 0;
    if (truth == kInf) {
      alarms += first < kInf ? 1 : 0;
      close += first == kInf ? 1 : 0;
      return;
    }
    ++contacts;
    early.push_back(truth - first);
    close += truth - first <= 0.005 ? 1 : 0;
  }

  std::string row(const std::string& name) const {
    char text[256];
    std::snprintf(text, sizeof text,
                  "| %s | %d | %d | %d | %.1f | %d | %.3f / %.3f / %.3f | %.0f | %.2f |\n",
                  name.c_str(), motions, contacts, late, 100.0 * close / motions, alarms,
                  1e3 * quantile(early, 0.5), 1e3 * quantile(early, 0.99),
                  1e3 * quantile(early, 1.0), quantile(steps, 0.5), 1e-3 * quantile(us, 0.5));
    return text;
  }
};

Tally measure_primitives() {
  ist::test::Rng rng(4);
  Tally tally;
  ist::benchmark::ThreadTimer timer;
  while (tally.motions < kMotions) {
    const ist::test::Arm arm = ist::test::random_arm(&rng);
    ist::TimeOfImpact impacts(arm.model, arm.kinematics, {});
    for (int i = 0; i < 25 && tally.motions < kMotions; ++i) {
      const ist::test::ArmMotion motion = ist::test::random_motion(&rng, arm);
      const double truth = ist::test::sampled_impact(arm, motion);
      if (truth == 0.0) continue;  // in contact from the start
      const ist::CloudSnapshot cloud = ist::test::make_snapshot(motion.points);
      std::vector<ist::ImpactTime> found;
      timer.lap();
      impacts.run(motion.joints, motion.still, motion.X_FR, std::vector<bool>(arm.size(), true),
                  {&cloud}, &found);
      tally.add(found, truth, timer.lap());
    }
  }
  return tally;
}

// Moves the Panda's visual meshes in a depth image from one recorded configuration to another. The
// truth is the exact distance at every millisecond, by a query at tolerance 0 (doc/accuracy.md).
class Panda {
 public:
  Panda(const std::filesystem::path& data, const std::string& cache)
      : cloud_(ist::test::truth_cloud(data, "mosd0")),
        joints_(ist::test::read_npy((data / "poses/rand_joints.npy").string())) {
    const ist::PackageFinder find = [&data](const std::string& name) {
      return (data / "robots" / name).string();
    };
    const auto description = ist::parse_urdf(
        ist::test::read_text((data / "robots/franka_description/robots/panda.urdf").string()),
        ist::GeometrySource::kVisual, find);
    ist::RobotModelConfig config;
    config.cache_directory = cache;
    model_ = ist::build_robot_model(description, config);
    kinematics_ = std::make_shared<const ist::Kinematics>(description);
    // The base stands at the table's edge, in contact with points measured there.
    for (const ist::LinkModel& link : model_->links) {
      wanted_.push_back(link.name != "panda_link0" && link.name != "panda_link1");
    }
  }

  Tally measure() {
    ist::test::Rng rng(8);
    Tally tally;
    ist::TimeOfImpact impacts(model_, kinematics_, {});
    ist::benchmark::ThreadTimer timer;
    const auto configurations = static_cast<double>(joints_.shape[0]);
    while (tally.motions < kPandaMotions) {
      const auto choose = [&] {
        return static_cast<std::size_t>(ist::test::uniform(&rng, 0.0, 0.9999) * configurations);
      };
      motion_ = {positions(choose()), positions(choose()), ist::test::uniform(&rng, 1.0, 3.0)};
      kinematics_->place_joints(motion_.from, &still_);
      const double truth = sampled_impact();
      if (truth == 0.0) continue;
      std::vector<ist::ImpactTime> found;
      timer.lap();
      impacts.run(motion_, still_, Eigen::Isometry3d::Identity(), wanted_, {&cloud_}, &found);
      tally.add(found, truth, timer.lap());
    }
    return tally;
  }

 private:
  std::vector<double> positions(std::size_t k) const {
    std::vector<double> q(kinematics_->joints().size(), 0.02);  // the fingers
    for (std::size_t i = 0; i < 7; ++i) {
      q[*kinematics_->find_joint("panda_joint" + std::to_string(i + 1))] =
          joints_.values[7 * k + i];
    }
    return q;
  }

  double distance(double time, ist::ProximityQuery* query) const {
    const double s = time / motion_.duration;
    std::vector<double> q;
    for (std::size_t j = 0; j < motion_.from.size(); ++j) {
      q.push_back((1.0 - s) * motion_.from[j] + s * motion_.to[j]);
    }
    std::vector<ist::LinkProximity> answers;
    query->run(ist::link_poses(*model_, *kinematics_, q).X_FL, wanted_, {&cloud_}, &answers);
    double smallest = query->config().max_distance;
    for (const ist::LinkProximity& answer : answers) {
      if (answer.state >= ist::LinkState::kNear) smallest = std::min(smallest, answer.distance);
    }
    return smallest;
  }

  double sampled_impact() const {
    constexpr double kStep = 1e-3, kFastest = 15.0;  // [s], [m/s] no point of it is faster
    ist::QueryConfig config;
    config.tolerance = 0.0;
    ist::ProximityQuery query(model_, config);
    double before = 0.0;
    for (double time = 0.0; time <= motion_.duration;) {
      const double d = distance(time, &query);
      if (d <= 0.0) {
        if (time == 0.0) return 0.0;
        while (time - before > 1e-9) {
          const double middle = 0.5 * (before + time);
          (distance(middle, &query) <= 0.0 ? time : before) = middle;
        }
        return time;
      }
      before = time;
      time += kStep * std::max(1.0, std::floor(d / (kFastest * kStep)));
    }
    return kInf;
  }

  ist::CloudSnapshot cloud_;
  ist::test::Npy joints_;
  std::shared_ptr<const ist::RobotModel> model_;
  std::shared_ptr<const ist::Kinematics> kinematics_;
  std::vector<bool> wanted_;
  ist::JointMotion motion_;
  ist::JointPoses still_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: time_of_impact CACHE_FOLDER [DOCUMENT]\n");
    return 1;
  }
  std::string table =
      "| motions of | motions | with contact | later than true | no more than 5 ms early [%] | "
      "contact reported where there is none | early, median / p99 / largest [ms] | queries | time "
      "[ms] |\n|---|---|---|---|---|---|---|---|---|\n";
  table += measure_primitives().row("random arms of primitives");
  if (const auto data = ist::test::data_dir()) {
    table += Panda(*data, argv[1]).measure().row("the Panda, recorded configurations");
  } else {
    std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
  }
  std::printf("%s", table.c_str());
  if (argc < 3) return 0;
  if (!ist::benchmark::write_table(argv[2], "time of impact", table)) return 1;
  return 0;
}
