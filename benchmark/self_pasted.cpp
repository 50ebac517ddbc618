// A self-filter on real depth images: the Panda is pasted into the Kinect frames of the test data,
// with noise, and moves through them. Answers without the robot's pixels are the truth. As
// Markdown.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "internal/geometry/ray_cast.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/scene.h"
#include "support.h"

namespace {

using ist::CloudSnapshot;
using ist::IngestConfig;
using ist::LinkProximity;
using ist::LinkState;
using ist::benchmark::DataSet;
using ist::benchmark::Frame;
using ist::benchmark::Poses;
using ist::benchmark::quantile;
using ist::benchmark::Scene;
using ist::benchmark::text_of;
using ist::benchmark::ThreadTimer;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kTold = 0.005;    // [m] an answer of no more than this tells a touch
constexpr double kClear = 0.03;    // [m] a link that is farther from the scene is clear of it
constexpr std::size_t kStep = 33;  // configurations at 1 kHz between two images

// Directions of all pixels, from those that were measured: a pinhole camera's.
std::vector<Eigen::Vector3d> rays_of(const Frame& frame) {
  // Least squares of x / z over columns, and of y / z over rows.
  Eigen::Matrix2d across = Eigen::Matrix2d::Zero(), down = across;
  Eigen::Vector2d x = Eigen::Vector2d::Zero(), y = x;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const Eigen::Vector3d p = frame.point(i).cast<double>();
    if (!p.allFinite()) continue;
    const Eigen::Vector2d c(static_cast<double>(i % frame.width), 1.0),
        r(static_cast<double>(i / frame.width), 1.0);
    across += c * c.transpose();
    down += r * r.transpose();
    x += p.x() / p.z() * c;
    y += p.y() / p.z() * r;
  }
  const Eigen::Vector2d u = across.inverse() * x, v = down.inverse() * y;
  std::vector<Eigen::Vector3d> rays(frame.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i] = Eigen::Vector3d(u[0] * static_cast<double>(i % frame.width) + u[1],
                              v[0] * static_cast<double>(i / frame.width) + v[1], 1.0)
                  .normalized();
  }
  return rays;
}

// The robot as this camera sees it, before what the frame shows.
struct Pasted {
  Frame image;  // with the robot
  Frame scene;  // what the robot does not hide; its own pixels are NaN
};

Pasted paste(const Frame& frame, const std::vector<Eigen::Vector3d>& rays,
             const ist::RobotModel& model, const Poses& X_FL, const ist::RangeNoise& noise,
             std::mt19937_64* random) {
  Pasted pasted{frame, frame};
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double measured = frame.point(i).norm();
    double nearest = std::isnan(measured) ? kInf : measured;
    bool is_robot = false;
    for (std::size_t k = 0; k < model.links.size(); ++k) {
      const ist::InnerSphereTree& tree = model.links[k].tree;
      const Eigen::Isometry3d X_LS = X_FL[k].inverse() * frame.X_FS;
      const Eigen::Vector3d d_L = X_LS.linear() * rays[i], o_L = X_LS.translation();
      if ((tree.center() - o_L).cross(d_L).norm() > tree.radius() + 0.02) continue;
      const ist::RayHit hit = ist::ray_cast(model.links[k].solid, o_L, d_L, nearest);
      if (!(hit.t < nearest)) continue;
      nearest = hit.t;
      is_robot = true;
    }
    if (!is_robot) continue;
    const Eigen::Vector3f p =
        ((nearest + noise.sigma(nearest) * normal(*random)) * rays[i]).cast<float>();
    for (int axis = 0; axis < 3; ++axis) {
      pasted.image.data[4 * i + static_cast<std::size_t>(axis)] = p[axis];
      pasted.scene.data[4 * i + static_cast<std::size_t>(axis)] = static_cast<float>(kNan);
    }
  }
  return pasted;
}

// A self-filter, or none, and the answers with it.
struct Trial {
  ist::Ingest ingest;
  ist::ProximityQuery query;
  CloudSnapshot cloud;
  std::vector<LinkProximity> answers;
  std::vector<double> us;
  int touching = 0, told = 0, clear = 0, false_touches = 0;

  Trial(const std::shared_ptr<const ist::RobotModel>& model, const IngestConfig& config)
      : ingest(config), query(model, {}) {}

  void run(const Frame& frame, const std::vector<ist::PosedSolid>& posed, const Poses& X_FL,
           double stamp) {
    const std::vector<bool> known(X_FL.size(), true);
    ThreadTimer timer;
    ingest.run(frame.raw(), frame.X_FS, posed, stamp, &cloud);
    us.push_back(timer.lap());
    query.run(X_FL, known, {&cloud}, &answers);
  }
};

double distance_of(const LinkProximity& answer) {
  return answer.state >= LinkState::kNear ? answer.distance : kInf;
}

void count(const std::vector<LinkProximity>& truth, Trial* trial) {
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double exact = distance_of(truth[i]);
    const bool is_told = distance_of(trial->answers[i]) <= kTold;
    if (exact <= kTold) {
      ++trial->touching;
      trial->told += is_told ? 1 : 0;
    } else if (exact > kClear) {
      ++trial->clear;
      trial->false_touches += is_told ? 1 : 0;
    }
  }
}

std::string row(const std::string& name, const char* mode, const Trial& trial, double padding_us) {
  const double us = quantile(trial.us, 0.5);
  return text_of("| %s | `%s` | %d of %d | %d of %d | %.2f / %.2f ms | %.2f |\n", name.c_str(),
                 mode, trial.told, trial.touching, trial.false_touches, trial.clear, 1e-3 * us,
                 1e-3 * quantile(trial.us, 0.99), us / padding_us);
}

std::string rows(const Scene& scene, const std::shared_ptr<const ist::RobotModel>& model,
                 const std::vector<Poses>& motion, std::size_t images) {
  IngestConfig none, view;
  none.self_filter = false;
  view.self_filter_mode = ist::SelfFilterMode::kView;
  Trial truth(model, none), by_padding(model, IngestConfig()), by_view(model, view);
  const std::vector<Eigen::Vector3d> rays = rays_of(scene.frame);
  const std::vector<bool> known(model->links.size(), true);
  std::mt19937_64 random(1);
  for (std::size_t i = 0; i < images && i * kStep < motion.size(); ++i) {
    const Poses& X_FL = motion[i * kStep];
    const Pasted pasted = paste(scene.frame, rays, *model, X_FL, view.view.noise, &random);
    const auto posed = ist::posed_solids(*model, X_FL, known);
    const double stamp = 0.001 * static_cast<double>(i * kStep);
    truth.run(pasted.scene, {}, X_FL, stamp);
    for (Trial* trial : {&by_padding, &by_view}) {
      trial->run(pasted.image, posed, X_FL, stamp);
      count(truth.answers, trial);
    }
  }
  const double us = quantile(by_padding.us, 0.5);
  return row(scene.name, "padding", by_padding, us) + row(scene.name, "view", by_view, us);
}

}  // namespace

int main(int argc, char** argv) {
  std::string cache;
  std::size_t images = 180;
  ist::benchmark::CommandLine line("A self-filter on recorded depth images.");
  line.add_option("cache", cache, "Folder that keeps packings")->required();
  line.add_option("--images", images, "Of each scene");
  line.read(argc, argv);
  const DataSet set = ist::benchmark::kinect_data(ist::benchmark::data_or_exit(), cache);
  const auto model = set.robot.pack(ist::PackingConfig().max_error);
  std::string table =
      "| frame | mode | links within 5 mm of the scene: told | links 3 cm from it and more: told | "
      "ingest, median / p99 | / `padding` |\n|---|---|---|---|---|---|\n";
  for (const Scene& scene : set.scenes) table += rows(scene, model, set.motion, images);
  return line.publish("self pasted", table);
}
