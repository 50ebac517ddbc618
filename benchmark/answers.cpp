// Every answer of many queries, bit for bit, so that two builds can be compared with `diff`.
//
// One line per packing, cloud and answer; numbers are hexadecimal floats. The cases are: packings
// in every order; the Panda among three Kinect frames (needs the test data: IST_PROXIMITY_DATA, or
// ../shared/data); a motion of small steps in which the clouds change; maps of boxes; the hard
// scenes and random links of the tests.
//
// Usage: answers [FILE]      writes to standard output where no file is named

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "answers/answer_file.h"
#include "answers/scenes.h"
#include "internal/geometry/mesh_io.h"
#include "internal/packing/packer.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/box_oracle.h"
#include "support/hard_scenes.h"
#include "support/random_links.h"
#include "truth_scenes.h"

namespace {

using ist::benchmark::AnswerFile;
using ist::benchmark::Poses;

constexpr double kTolerances[] = {0.0, 0.001, 0.005};  // [m]
constexpr int kStepsPerCloud = 100;
constexpr int kRandomRounds = 60;

// Packs a shape in every order.
void write_packings(const std::string& name, const ist::Shape& shape, double max_error,
                    AnswerFile* out) {
  for (const auto order :
       {ist::PackingOrder::kMedial, ist::PackingOrder::kDisjoint, ist::PackingOrder::kVolume}) {
    ist::PackingConfig config;
    config.max_error = max_error;
    config.max_spheres = 1500;
    config.order = order;
    ist::benchmark::write_packing(name + " order " + std::to_string(static_cast<int>(order)),
                                  ist::pack_element(shape, config), out);
  }
}

// The shapes are closed, concave, with holes, of triangles that cross, and the Panda's.
void write_packings(const std::filesystem::path& data, AnswerFile* out) {
  ist::test::Rng rng(1);
  const std::vector<ist::LinkGeometry> links = ist::test::random_links(&rng);
  for (std::size_t i = 0; i < links.size(); ++i) {
    write_packings("shape " + std::to_string(i), links[i][0].shape, 0.003, out);
  }
  for (std::size_t i = 0; i + 1 < ist::test::kPandaLinks; ++i) {
    const std::string name = ist::test::panda_mesh(i);
    const auto file = data / "robots/franka_description/meshes/visual" / (name + ".dae");
    write_packings(name, ist::load_mesh(file.string()), 0.005, out);
  }
}

// A query answers all links, a second one their minimum, a third one link by link.
class Queries {
 public:
  Queries(const std::shared_ptr<const ist::RobotModel>& model, const ist::QueryConfig& config)
      : all_(model, config), minimum_(model, config), one_(model, config) {}

  void set_config(const ist::QueryConfig& config) {
    for (ist::ProximityQuery* query : {&all_, &minimum_, &one_}) query->set_config(config);
  }

  void run(const std::string& name, const Poses& X_FL, const std::vector<bool>& known,
           const std::vector<const ist::CloudSnapshot*>& clouds, AnswerFile* out) {
    const bool complete = all_.run(X_FL, known, clouds, &links_);
    out->answers(name, complete, links_);
    minimum_.run_minimum(X_FL, known, clouds, &robot_);
    out->minimum(name, robot_);
    const std::size_t link = step_++ % X_FL.size();
    if (!known[link]) return;
    one_.run_link(link, X_FL[link], clouds, &links_[link]);
    out->answer(name + " alone " + std::to_string(link), links_[link]);
  }

 private:
  ist::ProximityQuery all_, minimum_, one_;
  std::vector<ist::LinkProximity> links_;
  ist::RobotProximity robot_;
  std::size_t step_ = 0;
};

void write_truth(const std::shared_ptr<const ist::RobotModel>& model, const std::string& name,
                 const std::vector<ist::benchmark::TruthScene>& scenes, AnswerFile* out) {
  const std::vector<bool> known(model->links.size(), true);
  for (const double tolerance : kTolerances) {
    for (std::size_t s = 0; s < scenes.size(); ++s) {
      ist::QueryConfig config;
      config.max_distance = 10.0;
      config.tolerance = tolerance;
      Queries queries(model, config);
      for (std::size_t k = 0; k < scenes[s].cases.size(); ++k) {
        queries.run("truth " + name + " tolerance " + std::to_string(tolerance) + " scene " +
                        std::to_string(s) + " pose " + std::to_string(k),
                    scenes[s].cases[k].X_FL, known, {scenes[s].cloud.get()}, out);
      }
    }
  }
}

// One frame after another, at times with a map beside it; the first frame comes again in the end.
void write_motion(const std::shared_ptr<const ist::RobotModel>& model, const std::string& name,
                  const std::filesystem::path& data, AnswerFile* out) {
  const std::vector<Poses> motion = ist::benchmark::small_steps(data);
  std::vector<bool> known(model->links.size(), true);
  std::vector<ist::CloudSnapshot> frames;
  for (const char* frame : {"mosd0", "mosd10", "mosd40"}) {
    const double region_radius = frames.size() == 1 ? 0.6 : 3.0;  // links look beyond the smaller
    frames.push_back(ist::benchmark::ingested(
        data, frame, ist::posed_solids(*model, motion[0], known), region_radius));
    out->line("cloud " + std::string(frame) + " points " +
              std::to_string(frames.back().index.size()));
  }
  Eigen::Isometry3d X_FM(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()));
  const ist::CloudSnapshot map = ist::benchmark::map_of_boxes(X_FM);
  for (const double tolerance : kTolerances) {
    ist::QueryConfig config;
    config.tolerance = tolerance;
    Queries queries(model, config);
    for (std::size_t step = 0; step < motion.size(); ++step) {
      const std::size_t turn = step / kStepsPerCloud;
      std::vector<const ist::CloudSnapshot*> clouds = {&frames[turn % frames.size()]};
      if (turn % 2 == 1) clouds.push_back(&map);
      known[7] = step % 50 != 0;
      queries.run("motion " + name + " tolerance " + std::to_string(tolerance) + " step " +
                      std::to_string(step),
                  motion[step], known, clouds, out);
    }
    for (std::size_t step = 0; step < motion.size(); step += 5) {
      queries.run("map " + name + " tolerance " + std::to_string(tolerance) + " step " +
                      std::to_string(step),
                  motion[step], std::vector<bool>(known.size(), true), {&map}, out);
    }
  }
}

void write_hard_scenes(AnswerFile* out) {
  const std::vector<ist::test::HardScene> scenes = ist::test::hard_scenes();
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    const ist::test::HardScene& scene = scenes[s];
    const auto model = ist::test::model_of(scene.links, 0.005);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = scene.far;
    for (std::size_t k = 0; k < scene.clouds.size(); ++k) {
      std::vector<Eigen::Vector3d> points = scene.clouds[k];
      for (Eigen::Vector3d& p : points) p += scene.far;
      const ist::CloudSnapshot cloud = ist::test::make_snapshot(points, scene.far);
      for (const double tolerance : kTolerances) {
        ist::QueryConfig config;
        config.tolerance = tolerance;
        Queries(model, config)
            .run("hard scene " + std::to_string(s) + " cloud " + std::to_string(k) + " tolerance " +
                     std::to_string(tolerance),
                 Poses(scene.links.size(), X_FL), std::vector<bool>(scene.links.size(), true),
                 {&cloud}, out);
      }
    }
  }
}

void write_random_links(AnswerFile* out) {
  ist::test::Rng rng(5);
  const std::vector<ist::LinkGeometry> links = ist::test::random_links(&rng);
  const auto model = ist::test::model_of(links, 0.01);
  const std::vector<bool> known(links.size(), true);
  Queries queries(model, {});
  for (int round = 0; round < kRandomRounds; ++round) {
    std::vector<Eigen::Vector3d> points;
    for (const ist::LinkGeometry& link : links) {
      const auto more = ist::test::random_points(&rng, link, 1 + round % 40);
      points.insert(points.end(), more.begin(), more.end());
    }
    const ist::CloudSnapshot cloud =
        ist::test::make_snapshot(points, ist::test::random_vector(&rng, 0.1));
    std::vector<Eigen::AlignedBox3d> boxes;
    for (int i = 0; i < 5 + round; ++i) {
      boxes.push_back(ist::test::random_leaf(&rng, 0.8, 0.005, 5));
    }
    const ist::CloudSnapshot map = ist::test::make_map(boxes, ist::test::random_pose(&rng, 0.1));
    ist::QueryConfig config;
    config.tolerance = kTolerances[round % 3];
    config.relative_tolerance = round % 4 == 0 ? 0.05 : 0.0;
    config.margin = round % 5 == 0 ? 0.003 : 0.0;
    config.max_distance = round % 2 == 0 ? 1.0 : 0.2;
    queries.set_config(config);
    Poses X_FL(links.size(), Eigen::Isometry3d::Identity());
    for (int step = 0; step < 6; ++step) {
      queries.run("random round " + std::to_string(round) + " step " + std::to_string(step), X_FL,
                  known, {step % 3 == 2 ? &map : &cloud}, out);
      for (Eigen::Isometry3d& X : X_FL) {
        X.translate(ist::test::random_vector(&rng, 0.005));
        X.rotate(Eigen::AngleAxisd(0.01, ist::test::random_vector(&rng, 1.0).normalized()));
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  std::FILE* const file = argc > 1 ? std::fopen(argv[1], "w") : stdout;
  if (file == nullptr) {
    std::perror(argv[1]);
    return 1;
  }
  AnswerFile out(file);
  write_packings(data, &out);
  write_hard_scenes(&out);
  write_random_links(&out);
  const auto scenes = ist::benchmark::truth_scenes(data);
  for (const double max_error : {0.005, 0.002}) {
    const auto model = ist::test::panda_model(data, max_error);
    const std::string name = "panda at " + std::to_string(max_error);
    for (const ist::LinkModel& link : model->links) {
      ist::benchmark::write_packing(name + " " + link.name, link.packing, &out);
    }
    write_truth(model, name, scenes, &out);
    write_motion(model, name, data, &out);
  }
  return std::fclose(file) == 0 ? 0 : 1;
}
