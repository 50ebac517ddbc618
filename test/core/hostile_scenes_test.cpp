// Sequences of queries that change everything in between: pose, settings, packing, clouds, deadline
// and the kind of query. Bounds hold at every answer, against brute force in double.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "internal/bvh/build_id.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/broken_promise.h"
#include "support/distance_fields.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

/// One of the links as a robot of its own, in packings that take each other's place.
struct Robot {
  LinkGeometry geometry;
  std::vector<std::shared_ptr<const RobotModel>> packings;
};

std::vector<Robot> robots(test::Rng* rng) {
  const std::vector<LinkGeometry> links = test::random_links(rng);
  std::vector<Robot> robots;
  for (const LinkGeometry& link : links) robots.push_back({link, {}});
  for (const double max_error : {0.05, 0.01}) {
    std::shared_ptr<const RobotModel> all = test::model_of(links, max_error);
    if (max_error == 0.01) all = test::with_fields(all, 2);
    for (std::size_t i = 0; i < links.size(); ++i) {
      auto alone = std::make_shared<RobotModel>();
      alone->links = {all->links[i]};
      LinkModel& link = alone->links[0];
      link.packing_id = next_build_id();
      std::vector<std::shared_ptr<const RobotModel>>& packings = robots[i].packings;
      alone->geometry_id = packings.empty() ? next_build_id() : packings[0]->geometry_id;
      if (!packings.empty()) link.solid = packings[0]->links[0].solid;
      packings.push_back(alone);
    }
  }
  return robots;
}

struct Cloud {
  std::vector<Eigen::Vector3d> points;  // in the fixed frame, as they were measured
  std::shared_ptr<std::vector<float>> message;
  CloudSnapshot snapshot;
};

/// Points all at one distance from the surface, on either side.
std::vector<Eigen::Vector3d> shell(test::Rng* rng, const LinkGeometry& link, int count) {
  const auto* mesh = std::get_if<TriangleMesh>(&link[0].shape);
  if (mesh == nullptr) return test::random_points(rng, link, count);
  const double offset = test::power_of_ten(rng, -6.0, -1.5) * (test::chance(rng, 0.5) ? 1.0 : -1.0);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const std::size_t t = test::below(rng, mesh->triangles.size());
    const Eigen::Vector3d a = mesh->corner(t, 0), b = mesh->corner(t, 1), c = mesh->corner(t, 2);
    const Eigen::Vector3d n = (b - a).cross(c - a);
    const double u = test::uniform(rng, 0.0, 1.0), v = test::uniform(rng, 0.0, 1.0 - u);
    points.push_back(link[0].X_LE *
                     (a + u * (b - a) + v * (c - a) + offset / std::max(n.norm(), 1e-30) * n));
  }
  return points;
}

/// A wall, a ball beside the link, a shell about it, or a block; near the link or far from it.
std::vector<Eigen::Vector3d> dense(test::Rng* rng, int count) {
  const std::size_t kind = test::below(rng, 4);
  const double far = test::power_of_ten(rng, -2.0, 0.3);
  const Eigen::Isometry3d X = test::random_pose(rng, 0.1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d u = test::random_vector(rng, 1.0);
    const Eigen::Vector3d places[] = {X * Eigen::Vector3d(u.x(), u.y(), far + 0.002 * u.z()),
                                      X * (0.05 * u.normalized() + far * Eigen::Vector3d::UnitX()),
                                      X * (far * u.normalized()), u};
    points.push_back(places[kind]);
  }
  return points;
}

/// Through the ingest, as an image or a list: points are read from the message when a query comes.
void ingest(test::Rng* rng, Cloud* cloud) {
  const std::size_t size = cloud->points.size();
  const std::size_t width =
      test::chance(rng, 0.5) ? size
                             : std::max<std::size_t>(1, static_cast<std::size_t>(std::sqrt(size)));
  const std::size_t height = size / width;
  cloud->points.resize(width * height);
  const Eigen::Isometry3d X_FS = test::random_pose(rng, test::power_of_ten(rng, -1.0, 1.0));
  const Eigen::Isometry3d X_SF = X_FS.inverse();
  cloud->message = std::make_shared<std::vector<float>>();
  for (Eigen::Vector3d& p_F : cloud->points) {
    const Eigen::Vector3f p_S = (X_SF * p_F).cast<float>();
    cloud->message->insert(cloud->message->end(), p_S.data(), p_S.data() + 3);
    p_F = X_FS * p_S.cast<double>();
  }
  RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(cloud->message->data());
  raw.width = width;
  raw.height = height;
  raw.point_step = 3 * sizeof(float);
  raw.row_step = raw.point_step * width;
  raw.y = sizeof(float);
  raw.z = 2 * sizeof(float);
  raw.owner = cloud->message;
  Ingest(test::whole_cloud()).run(raw, X_FS, {}, 0.0, &cloud->snapshot);
}

std::unique_ptr<Cloud> random_cloud(test::Rng* rng, const LinkGeometry& link,
                                    const Eigen::Isometry3d& X_FL) {
  auto cloud = std::make_unique<Cloud>();
  const int count = 1 + static_cast<int>(std::pow(test::uniform(rng, 0.0, 1.0), 3.0) * 150.0);
  cloud->points = test::chance(rng, 0.3)   ? shell(rng, link, count)
                  : test::chance(rng, 0.2) ? dense(rng, count)
                                           : test::random_points(rng, link, count);
  for (Eigen::Vector3d& p : cloud->points) p = X_FL * p;
  if (test::chance(rng, 0.3)) {
    ingest(rng, cloud.get());
  } else {
    cloud->snapshot = test::make_snapshot(cloud->points, test::random_vector(rng, 1.0));
  }
  return cloud;
}

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.0, 0.0, 1e-5, 0.001, 0.01, 0.1};
  QueryConfig config;
  config.tolerance = kTolerances[test::below(rng, 7)];
  config.max_distance = test::power_of_ten(rng, -2.0, 0.5);
  config.margin = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 0.05);
  config.relative_tolerance = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 1.0);
  if (test::chance(rng, 0.4))
    config.deadline = test::chance(rng, 0.3) ? 1e-12 : test::power_of_ten(rng, -6.5, -4.0);
  return config;
}

/// All settings change, or one of them.
QueryConfig changed(test::Rng* rng, QueryConfig config) {
  const QueryConfig other = random_config(rng);
  switch (test::below(rng, 6)) {
    case 0:
      config.tolerance = other.tolerance;
      return config;
    case 1:
      config.margin = other.margin;
      return config;
    case 2:
      config.relative_tolerance = other.relative_tolerance;
      return config;
    case 3:
      config.max_distance = other.max_distance;
      return config;
    default:
      return other;
  }
}

class HostileScenes : public testing::Test {
 protected:
  void run_sequence(const Robot& robot) {
    Eigen::Isometry3d X_FL = test::random_pose(&rng_, test::power_of_ten(&rng_, -2.0, 0.7));
    std::vector<std::unique_ptr<Cloud>> clouds;
    for (std::size_t i = 1 + test::below(&rng_, 4) / 2; i > 0; --i) {
      clouds.push_back(random_cloud(&rng_, robot.geometry, X_FL));
    }
    ProximityQuery query(robot.packings[0], random_config(&rng_));
    for (int step = 0; step < 15 && !HasFailure(); ++step) {
      if (test::chance(&rng_, 0.4)) query.set_config(changed(&rng_, query.config()));
      if (test::chance(&rng_, 0.2)) query.set_model(robot.packings[test::below(&rng_, 2)]);
      if (test::chance(&rng_, 0.1)) {
        clouds[test::below(&rng_, clouds.size())] = random_cloud(&rng_, robot.geometry, X_FL);
      }
      if (test::chance(&rng_, 0.6)) X_FL = X_FL * test::small_motion(&rng_, -1.5);
      if (test::chance(&rng_, 0.05)) X_FL = X_FL * test::random_pose(&rng_, 0.2);
      check(robot, X_FL, clouds, &query);
    }
  }

  void check(const Robot& robot, const Eigen::Isometry3d& X_FL,
             const std::vector<std::unique_ptr<Cloud>>& clouds, ProximityQuery* query) {
    test::SceneTruth truth;
    truth.is_closed = robot.packings[0]->links[0].solid.is_closed();
    truth.scale = 1.0 + X_FL.translation().norm();
    std::vector<const CloudSnapshot*> snapshots;
    for (const auto& cloud : clouds) {
      snapshots.push_back(&cloud->snapshot);
      truth.measured.add(test::truth_interval(robot.geometry, X_FL, cloud->points));
      truth.stored.add(
          test::truth_interval(robot.geometry, X_FL, test::stored_points(cloud->snapshot.index)));
    }
    const SnapshotSpan span(snapshots.data(), snapshots.size());
    LinkProximity answer;
    const bool is_complete = ask(X_FL, span, query, &answer);
    ++answers_;
    contacts_ += answer.state == LinkState::kContact ? 1 : 0;
    stopped_ += is_complete ? 0 : 1;
    EXPECT_EQ(test::broken_promise(answer, truth, query->config(), is_complete), "");
    if (answer.state >= LinkState::kNear) test::expect_witness(answer, X_FL, truth.scale);
  }

  // In one of the three ways.
  bool ask(const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, ProximityQuery* query,
           LinkProximity* answer) {
    const std::vector<Eigen::Isometry3d> poses = {X_FL};
    if (test::chance(&rng_, 0.25)) return query->run_link(0, X_FL, clouds, answer);
    if (test::chance(&rng_, 0.3)) {
      RobotProximity nearest;
      const bool is_complete = query->run_minimum(poses, {true}, clouds, &nearest);
      *answer = nearest.nearest;
      return is_complete;
    }
    std::vector<LinkProximity> answers;
    const bool is_complete = query->run(poses, {true}, clouds, &answers);
    *answer = answers[0];
    return is_complete;
  }

  test::Rng rng_{2211};
  int answers_ = 0, contacts_ = 0, stopped_ = 0;
};

TEST_F(HostileScenes, BoundsHold) {
  const std::vector<Robot> all = robots(&rng_);
  const int sequences = test::scaled(2000);
  for (int i = 0; i < sequences && !HasFailure(); ++i) {
    const std::size_t robot = static_cast<std::size_t>(i) % all.size();
    SCOPED_TRACE("sequence " + std::to_string(i) + ", link " + std::to_string(robot));
    run_sequence(all[robot]);
  }
  if (HasFailure()) return;
  EXPECT_GT(contacts_, answers_ / 10);
  EXPECT_GT(stopped_, answers_ / 50);
}

}  // namespace
}  // namespace ist
