// Links against a known world, beside FCL in the same run: two arms in one cell, and a
// cell of meshes with a thousand objects that are far. Motions at 1 kHz. With a document, writes
// its table there.
//
// Usage: world [DOCUMENT] [steps]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "document.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support.h"
#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/scene.h"
#ifdef IST_PROXIMITY_HAS_FCL
#include "fcl_geometry.h"
#endif

namespace {

using ist::LinkGeometry;
using ist::WorldObject;
using ist::benchmark::quantile;
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

// Links and objects as triangles: round shapes to 0.1 mm.
LinkGeometry as_meshes(const LinkGeometry& geometry) {
  LinkGeometry meshes = geometry;
  for (ist::GeometryElement& element : meshes) {
    if (const auto* box = std::get_if<ist::Box>(&element.shape)) {
      element.shape = ist::tessellate(*box).mesh;
    } else if (const auto* cylinder = std::get_if<ist::Cylinder>(&element.shape)) {
      element.shape = ist::tessellate(*cylinder, 1e-4).mesh;
    } else if (const auto* sphere = std::get_if<ist::Sphere>(&element.shape)) {
      element.shape = ist::tessellate(*sphere, 1e-4).mesh;
    }
  }
  return meshes;
}

#ifdef IST_PROXIMITY_HAS_FCL
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
#endif

struct Case {
  std::string name;
  ist::RobotDescription robot;
  std::vector<WorldObject> objects;
  // By frame of the world and time; "cell" stands still.
  std::shared_ptr<const ist::RobotModel> other;  // null: none
  bool is_meshes = false;
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

// The objects of a case, and the links of the other robot if it has one.
std::vector<WorldObject> objects_of(const Case& c, const ist::RobotModel& model,
                                    const std::vector<LinkGeometry>& links) {
  std::vector<WorldObject> objects = c.objects;
  for (std::size_t i = 0; c.other && i < links.size(); ++i) {
    WorldObject one = object("other " + model.links[i].name, ist::Sphere{1.0},
                             Eigen::Vector3d::Zero(), "other " + model.links[i].name);
    one.geometry = links[i];
    objects.push_back(one);
  }
  return objects;
}

// Places the links of the other robot.
void place_other(const ist::RobotModel& model, const ist::LinkPoses& other,
                 ist::PosedWorld* world) {
  for (std::size_t f = 0; f < world->X_FB.size(); ++f) {
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      if (world->world->frames()[f] == "other " + model.links[i].name) {
        world->X_FB[f] = other.X_FL[i];
      }
    }
  }
}

// The rows of a case, at tolerances of 1 mm and 0.
std::string measure(const Case& c, int steps) {
  ist::RobotModelConfig packing;
  packing.packing.max_error = 0.01;
  const auto model = ist::build_robot_model(c.robot, packing);
  const auto kinematics = std::make_shared<const ist::Kinematics>(c.robot);
  ist::ForwardKinematics forward(*model, kinematics), forward_other(*model, kinematics);
  const std::vector<LinkGeometry> links = shapes_of(c, *model);
  const std::vector<WorldObject> objects = objects_of(c, *model, links);
  ist::WorldBuilder builder;
  builder.add(objects);
  ist::PosedWorld world{builder.world(), {}};
  world.X_FB.assign(world.world->frames().size(), Eigen::Isometry3d::Identity());
  Eigen::Isometry3d X_FR = Eigen::Isometry3d::Identity();  // the other robot faces this one
  X_FR.translation().x() = 0.9;
  X_FR.linear() = Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitZ()).matrix();

  const auto robot = ist::make_robot_surfaces(model);
  std::vector<std::unique_ptr<ist::WorldQuery>> queries;
  for (const double tolerance : {0.001, 0.0}) {
    ist::QueryConfig config;
    config.tolerance = tolerance;
    queries.push_back(std::make_unique<ist::WorldQuery>(robot, config));
  }
  std::vector<std::size_t> frames;
  for (const WorldObject& one : objects) {
    const auto& names = world.world->frames();
    frames.push_back(
        static_cast<std::size_t>(std::find(names.begin(), names.end(), one.frame) - names.begin()));
  }
#ifdef IST_PROXIMITY_HAS_FCL
  Peer peer(links, objects, frames);
#endif
  std::vector<double> ours[2], peers;
  [[maybe_unused]] double differs = 0.0;
  std::vector<ist::LinkProximity> results;
  ist::benchmark::ThreadTimer timer;
  for (int step = 0; step < steps; ++step) {
    const ist::LinkPoses& poses = forward.run(position(*kinematics, 1e-3 * step, 0.0));
    if (c.other) {
      place_other(*model, forward_other.run(position(*kinematics, 1e-3 * step, 2.0), X_FR), &world);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      timer.lap();
      queries[k]->run(poses.X_FL, poses.known, {&world}, ist::TimePoint::max(), &results);
      ours[k].push_back(timer.lap());
    }
#ifdef IST_PROXIMITY_HAS_FCL
    if (step % kPeerStep == 0) {
      timer.lap();
      const std::vector<double>& found = peer.run(poses.X_FL, world.X_FB, c.other != nullptr);
      peers.push_back(timer.lap());
      for (std::size_t i = 0; i < found.size(); ++i) {
        if (results[i].state != ist::LinkState::kNear || !(found[i] > 0.0)) continue;
        differs = std::max(differs, std::abs(found[i] - results[i].distance));
      }
    }
#endif
  }
  const double of_peer = quantile(peers, 0.5);
  const auto ratio = [](double theirs, double of_ours) {
    char text[32] = "-";
    if (theirs > 0.0) std::snprintf(text, sizeof text, "%.0f", theirs / of_ours);
    return std::string(text);
  };
  char row[512];
  std::snprintf(row, sizeof row,
                "| %s: %zu links, %zu objects | %.0f | %.0f | %.0f | %.0f | %s | %s | %.2g |\n",
                c.name.c_str(), links.size(), objects.size(), quantile(ours[0], 0.5),
                quantile(ours[0], 0.99), quantile(ours[1], 0.5), of_peer,
                ratio(of_peer, quantile(ours[0], 0.5)).c_str(),
                ratio(of_peer, quantile(ours[1], 0.5)).c_str(), 1e3 * differs);
  std::printf("%s", row);
  std::fflush(stdout);
  return row;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string document = argc > 1 ? argv[1] : "";
  const int steps = argc > 2 ? std::atoi(argv[2]) : 4000;
  const ist::RobotDescription arm = ist::test::demo_robot();
  ist::RobotDescription mesh_arm = arm;
  for (ist::LinkDescription& link : mesh_arm.links) link.geometry = as_meshes(link.geometry);
  std::vector<Case> cases = {{"demo arm in a cell", arm, cell(false), nullptr, false},
                             {"the same of meshes", mesh_arm, cell(true), nullptr, true}};
  cases.push_back({"two arms in a cell", arm, cell(false), ist::test::demo_model(), false});
  cases.push_back({"the same of meshes", mesh_arm, cell(true), ist::test::demo_model(), true});
  Case far = {"with 1000 far objects", mesh_arm, cell(true), nullptr, true};
  for (int i = 0; i < 1000; ++i) {
    far.objects.push_back(object("far" + std::to_string(i), ist::Box{{0.2, 0.2, 0.2}},
                                 {3.0 + i % 10, i / 10 % 10 - 5.0, i / 100.0}));
  }
  cases.push_back(far);
  std::string rows =
      "| scene | ours to 1 mm, median [us] | p99 [us] | ours exact, median [us] | FCL [us] "
      "| FCL / ours | FCL / exact | largest difference [mm] |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const Case& c : cases) rows += measure(c, steps);
  if (document.empty()) return 0;
  return ist::benchmark::write_table(document, "known world", rows) ? 0 : 1;
}
