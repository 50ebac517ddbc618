// Links against a known world, beside FCL in the same run: two arms in one cell, and a
// cell of meshes with a thousand objects that are far. Motions at 1 kHz.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "fcl_geometry.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support.h"
#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/scene.h"

namespace {

using ist::LinkGeometry;
using ist::WorldObject;
using ist::benchmark::quantile;
using ist::benchmark::text_of;
// Peers are measured in every so many steps. They begin with what they found then.
constexpr int kPeerStep = 20;

using Poses = std::vector<Eigen::Isometry3d>;

WorldObject object(const std::string& name, const ist::Shape& shape, const Eigen::Vector3d& p,
                   const std::string& frame = "cell") {
  WorldObject result;
  result.name = name;
  result.frame = frame;
  result.geometry = {ist::GeometryElement{shape, Eigen::Isometry3d::Identity(), name}};
  result.X_BO.translation() = p;
  return result;
}

// Links and objects as triangles: round shapes to a thousandth of their radius.
LinkGeometry as_meshes(LinkGeometry geometry) {
  for (ist::GeometryElement& element : geometry) element.shape = ist::mesh_of(element.shape, 1e-3);
  return geometry;
}

using FclObject = std::unique_ptr<fcl::CollisionObjectd>;

// The elements of links or objects, each at its place in its body.
struct FclBodies {
  std::vector<FclObject> objects;
  std::vector<std::size_t> body;
  Poses X_BE;

  void add(const LinkGeometry& geometry, std::size_t of, const Eigen::Isometry3d& X) {
    for (const ist::GeometryElement& element : geometry) {
      objects.push_back(
          std::make_unique<fcl::CollisionObjectd>(ist::benchmark::fcl_geometry(element.shape)));
      body.push_back(of);
      X_BE.push_back(X * element.X_LE);
    }
  }
  void place(const Poses& X_FB) {
    for (std::size_t i = 0; i < objects.size(); ++i) {
      objects[i]->setTransform(X_FB[body[i]] * X_BE[i]);
      objects[i]->computeAABB();
    }
  }
};

// The nearest object of each link: the tree of boxes over all objects prunes them.
class Peer {
 public:
  Peer(const std::vector<LinkGeometry>& links, const std::vector<WorldObject>& world,
       const std::vector<std::size_t>& frames)
      : links_(links.size()) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      robot_.add(links[i], i, Eigen::Isometry3d::Identity());
    }
    for (std::size_t i = 0; i < world.size(); ++i) {
      objects_.add(world[i].geometry, frames[i], world[i].X_BO);
    }
    for (auto& one : objects_.objects) manager_.registerObject(one.get());
    manager_.setup();
  }

  const std::vector<double>& run(const Poses& X_FL, const Poses& X_FB, bool moves) {
    robot_.place(X_FL);
    if (moves || nearest_.empty()) {
      objects_.place(X_FB);
      manager_.update();
    }
    nearest_.assign(links_, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < robot_.objects.size(); ++i) {
      Data data;
      data.result.min_distance = std::min(nearest_[robot_.body[i]], 1.0);
      manager_.distance(robot_.objects[i].get(), &data, &Peer::measure);
      nearest_[robot_.body[i]] = std::min(nearest_[robot_.body[i]], data.result.min_distance);
    }
    return nearest_;
  }

 private:
  struct Data {
    fcl::DistanceRequestd request{true};
    fcl::DistanceResultd result;
  };
  static bool measure(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* of, double& least) {
    auto& data = *static_cast<Data*>(of);
    fcl::distance(a, b, data.request, data.result);
    least = data.result.min_distance;
    return least <= 0.0;
  }
  std::size_t links_;
  FclBodies robot_, objects_;
  fcl::DynamicAABBTreeCollisionManagerd manager_;
  std::vector<double> nearest_;
};

struct Case {
  std::string name;
  ist::RobotDescription robot;
  std::vector<WorldObject> objects;
  bool has_other = false;  // such a robot faces this one, and moves
};

// A table, walls, a pillar, a ball, and fixtures of rings.
std::vector<WorldObject> cell(bool meshes) {
  std::vector<WorldObject> objects = {
      object("table", ist::Box{{1.6, 1.6, 0.04}}, {0.0, 0.0, -0.1}),
      object("back wall", ist::Box{{0.05, 3.0, 2.0}}, {-0.9, 0.0, 0.9}),
      object("side wall", ist::Box{{3.0, 0.05, 2.0}}, {0.0, -1.0, 0.9}),
      object("pillar", ist::Cylinder{0.06, 1.2}, {-0.5, 0.6, 0.5}),
      object("ball", ist::Sphere{0.08}, {0.4, -0.4, 0.1})};
  for (int i = 0; i < 6; ++i) {
    const double angle = 1.0 * i;
    objects.push_back(object("fixture" + std::to_string(i), ist::test::torus(0.08, 0.02, 96, 48),
                             {0.6 * std::cos(angle), 0.6 * std::sin(angle), 0.0}));
  }
  if (meshes) {
    for (WorldObject& one : objects) one.geometry = as_meshes(one.geometry);
  }
  return objects;
}

// Joint positions of a slow motion.
std::vector<double> position(const ist::Kinematics& kinematics, double time, double phase) {
  std::vector<double> q;
  for (const auto& joint : kinematics.joints()) {
    const double low = std::max(joint.lower, -1.5), high = std::min(joint.upper, 1.5);
    const double share =
        0.5 + 0.45 * std::sin(0.7 * time + phase + 1.3 * static_cast<double>(q.size()));
    q.push_back(joint.is_free() ? low + share * (high - low) : 0.0);
  }
  return q;
}

// The shapes of the links that are monitored.
std::vector<LinkGeometry> shapes_of(const Case& c, const ist::RobotModel& model) {
  std::vector<LinkGeometry> links;
  for (const ist::LinkModel& link : model.links) {
    for (const auto& described : c.robot.links) {
      if (described.name == link.name) links.push_back(described.geometry);
    }
  }
  return links;
}

// A case's world, and where its objects are.
class World {
 public:
  World(const Case& c, const ist::RobotModel& model, const std::vector<LinkGeometry>& links)
      : objects_(c.objects) {
    for (std::size_t i = 0; c.has_other && i < links.size(); ++i) {
      const std::string name = "other " + model.links[i].name;
      objects_.push_back(object(name, ist::Sphere{1.0}, Eigen::Vector3d::Zero(), name));
      objects_.back().geometry = links[i];
    }
    ist::WorldBuilder builder;
    builder.add(objects_);
    posed_.world = builder.world();
    posed_.X_FB.assign(posed_.world->frames().size(), Eigen::Isometry3d::Identity());
    for (const WorldObject& one : objects_) frames_.push_back(frame_of(one.frame));
  }

  // @param X_FL  of the other robot
  void place_other(const Poses& X_FL) {
    for (std::size_t i = 0; i < X_FL.size(); ++i) {
      posed_.X_FB[frames_[objects_.size() - X_FL.size() + i]] = X_FL[i];
    }
  }

  const ist::PosedWorld& posed() const { return posed_; }
  const std::vector<WorldObject>& objects() const { return objects_; }
  const std::vector<std::size_t>& frames() const { return frames_; }  // by object

 private:
  std::size_t frame_of(const std::string& name) const {
    const auto& names = posed_.world->frames();
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  }

  std::vector<WorldObject> objects_;
  ist::PosedWorld posed_;
  std::vector<std::size_t> frames_;
};

// How much two answers differ at most where links are apart.
double largest_difference(const std::vector<double>& peer,
                          const std::vector<ist::LinkProximity>& ours) {
  double differs = 0.0;
  for (std::size_t i = 0; i < peer.size(); ++i) {
    if (ours[i].state != ist::LinkState::kNear || !(peer[i] > 0.0)) continue;
    differs = std::max(differs, std::abs(peer[i] - ours[i].distance));
  }
  return differs;
}

// The row of a case, at tolerances of 1 mm and 0.
std::string measure(const Case& c, int steps) {
  ist::RobotModelConfig packing;
  packing.packing.max_error = 0.01;
  const auto model = ist::build_robot_model(c.robot, packing);
  const auto kinematics = std::make_shared<const ist::Kinematics>(c.robot);
  ist::ForwardKinematics forward(*model, kinematics), forward_other(*model, kinematics);
  const std::vector<LinkGeometry> links = shapes_of(c, *model);
  World world(c, *model, links);
  Eigen::Isometry3d X_FR(Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::UnitZ()));
  X_FR.pretranslate(Eigen::Vector3d(0.9, 0.0, 0.0));  // the other robot faces this one

  const auto robot = ist::make_robot_surfaces(model);
  std::vector<std::unique_ptr<ist::WorldQuery>> queries;
  for (const double tolerance : {0.001, 0.0}) {
    ist::QueryConfig config;
    config.tolerance = tolerance;
    queries.push_back(std::make_unique<ist::WorldQuery>(robot, config));
  }
  Peer peer(links, world.objects(), world.frames());
  std::array<std::vector<double>, 2> ours;
  std::vector<double> peers;
  double differs = 0.0;
  std::vector<ist::LinkProximity> results;
  ist::benchmark::ThreadTimer timer;
  for (int step = 0; step < steps; ++step) {
    const ist::LinkPoses& poses = forward.run(position(*kinematics, 1e-3 * step, 0.0));
    if (c.has_other) {
      world.place_other(forward_other.run(position(*kinematics, 1e-3 * step, 2.0), X_FR).X_FL);
    }
    for (std::size_t k = 0; k < ours.size(); ++k) {
      timer.lap();
      queries[k]->run(poses.X_FL, poses.known, {&world.posed()}, ist::TimePoint::max(), &results);
      ours[k].push_back(timer.lap());
    }
    if (step % kPeerStep > 0) continue;
    timer.lap();
    const std::vector<double>& found = peer.run(poses.X_FL, world.posed().X_FB, c.has_other);
    peers.push_back(timer.lap());
    differs = std::max(differs, largest_difference(found, results));
  }
  const double of_peer = quantile(peers, 0.5);
  const double to_1_mm = quantile(ours[0], 0.5), exact = quantile(ours[1], 0.5);
  return text_of(
      "| %s: %zu links, %zu objects | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %.2g |\n",
      c.name.c_str(), links.size(), world.objects().size(), to_1_mm, quantile(ours[0], 0.99), exact,
      of_peer, of_peer / to_1_mm, of_peer / exact, 1e3 * differs);
}

}  // namespace

int main(int argc, char** argv) {
  int steps = 4000;
  ist::benchmark::CommandLine line("Links against a known world, beside FCL.");
  line.add_option("--steps", steps, "Of each motion, 1 ms apart");
  line.read(argc, argv);
  const ist::RobotDescription arm = ist::test::demo_robot();
  ist::RobotDescription mesh_arm = arm;
  for (ist::LinkDescription& link : mesh_arm.links) link.geometry = as_meshes(link.geometry);
  std::vector<Case> cases = {{"demo arm in a cell", arm, cell(false)},
                             {"the same of meshes", mesh_arm, cell(true)},
                             {"two arms in a cell", arm, cell(false), true},
                             {"the same of meshes", mesh_arm, cell(true), true},
                             {"with 1000 far objects", mesh_arm, cell(true)}};
  for (int i = 0; i < 1000; ++i) {
    cases.back().objects.push_back(object("far" + std::to_string(i), ist::Box{{0.2, 0.2, 0.2}},
                                          {3.0 + i % 10, i / 10 % 10 - 5.0, i / 100.0}));
  }
  std::string rows =
      "| scene | ours to 1 mm, median [us] | p99 [us] | ours exact, median [us] | FCL [us] "
      "| FCL / ours | FCL / exact | largest difference [mm] |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const Case& c : cases) rows += measure(c, steps);
  return line.publish("known world", rows);
}
