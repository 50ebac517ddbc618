// Link against link beside brute force: every triangle against every triangle.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "internal/geometry/convex_part.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"
#include "support/link_pair_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/truth.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;
using Exact = test::Corners3<long double>;

ConvexPart triangle(const Point& a, const Point& b, const Point& c) {
  ConvexPart part;
  part.a = a;
  part.b = b;
  part.c = c;
  return part;
}

long double truth_of(const ConvexPart& p, const ConvexPart& q) {
  const auto exact = [](const ConvexPart& part) {
    return Exact{
        {part.a.cast<long double>(), part.b.cast<long double>(), part.c.cast<long double>()}};
  };
  return test::oracle_triangles(exact(p), exact(q));
}

// The interval holds the truth, and is as narrow as rounding allows.
void check(const ConvexPart& p, const ConvexPart& q, double slack, const std::string& what) {
  const double size =
      std::max({p.a.norm(), p.b.norm(), p.c.norm(), q.a.norm(), q.b.norm(), q.c.norm()});
  const ConvexDistance found = triangle_distance(p, q);
  const auto truth = static_cast<double>(truth_of(p, q));
  const double rounding = 8e-15 * size;
  EXPECT_LE(found.lower_bound, truth + rounding) << what;
  EXPECT_GE(found.distance, truth - rounding) << what;
  EXPECT_NEAR((found.on_p - found.on_q).norm(), found.distance, rounding) << what;
  // Near touch the direction of the slab is that of two points which rounding moves.
  const double resolved =
      slack + rounding + 1e-12 * truth + 1e-15 * size * size / std::max(truth, 1e-9);
  EXPECT_LE(found.distance - found.lower_bound, std::max(resolved, truth < 1e-6 ? 1e-6 : 0.0))
      << what << " distance " << found.distance << " truth " << truth;
  EXPECT_LE(found.distance, truth + std::max(resolved, truth < 1e-9 ? 1e-9 : 0.0)) << what;
}

TEST(TriangleDistance, RandomTriangles) {
  test::Rng rng(1);
  for (int i = 0; i < test::scaled(100000); ++i) {
    const double size = std::pow(10.0, test::uniform(&rng, -3.0, 0.0));
    const Point offset = test::random_vector(&rng, 1.5 * size);
    const auto point = [&](const Point& about) {
      return Point(about + test::random_vector(&rng, size));
    };
    const ConvexPart p = triangle(point(Point::Zero()), point(Point::Zero()), point(Point::Zero()));
    const ConvexPart q = triangle(point(offset), point(offset), point(offset));
    check(p, q, 0.0, "random " + std::to_string(i));
    if (testing::Test::HasFailure()) return;
  }
}

// Parallel, coplanar, sharing a corner or an edge, piercing, slivers, and triangles without area.
TEST(TriangleDistance, HardTriangles) {
  test::Rng rng(2);
  for (int i = 0; i < test::scaled(100000); ++i) {
    const auto grid = [&] {  // few numbers, so that ties are frequent
      return 0.125 * std::floor(test::uniform(&rng, -2.0, 3.0));
    };
    const auto corner = [&] { return Point(grid(), grid(), grid()); };
    ConvexPart p = triangle(corner(), corner(), corner());
    ConvexPart q = triangle(corner(), corner(), corner());
    const int kind = i % 7;
    const Point lift(0, 0, std::pow(10.0, test::uniform(&rng, -5.0, -1.0)));
    if (kind == 1) {  // in parallel planes, or in one
      for (Point* v : {&p.a, &p.b, &p.c, &q.a, &q.b, &q.c}) v->z() = 0.0;
      if (i % 2 == 0) q = triangle(q.a + lift, q.b + lift, q.c + lift);
    } else if (kind == 2) {
      q.a = p.a;
    } else if (kind == 3) {
      q.a = p.a;
      q.b = p.b;
    } else if (kind == 4) {  // slivers
      p.c = 0.5 * (p.a + p.b) + lift.z() * 1e-4 * corner();
      q.c = 0.3 * q.a + 0.7 * q.b + lift.z() * 1e-4 * corner();
    } else if (kind == 5) {  // no area
      p.c = 0.5 * (p.a + p.b);
      if (i % 2 == 0) q.b = q.c = q.a;
    } else if (kind == 6) {  // the same triangle, lifted a little
      q = triangle(p.a + lift, p.b + lift, p.c + lift);
    }
    const double slack = kind == 4 ? 1e-8 : 0.0;  // the direction of a sliver's normal
    check(p, q, slack, "kind " + std::to_string(kind) + " case " + std::to_string(i));
    if (testing::Test::HasFailure()) return;
  }
}

// Cylinders and spheres against points of a fine scan of their own.
TEST(ConvexDistance, CylindersAndSpheres) {
  test::Rng rng(3);
  for (int i = 0; i < test::scaled(2000); ++i) {
    const auto cylinder = [&](double size) {
      ConvexPart part;
      part.kind = ConvexPart::Kind::kCylinder;
      part.a = test::random_vector(&rng, size);
      part.b = test::random_vector(&rng, 0.1);
      part.c = part.a;
      part.radius = test::uniform(&rng, 0.005, 0.1);
      return part;
    };
    const ConvexPart p = cylinder(0.05), q = i % 2 == 0 ? cylinder(0.5)
                                                        : triangle(test::random_vector(&rng, 0.4),
                                                                   test::random_vector(&rng, 0.4),
                                                                   test::random_vector(&rng, 0.4));
    const ConvexDistance found = convex_distance(p, q);
    if (found.distance > 0.0) {
      EXPECT_LE(found.distance - found.lower_bound, 1e-9) << i;
    }
    EXPECT_LE(found.lower_bound, found.distance);
    // Both points are in their parts.
    const auto off = [](const ConvexPart& part, const Point& x) {
      if (part.kind == ConvexPart::Kind::kTriangle) {
        ConvexPart point;
        point.a = point.b = point.c = x;
        return static_cast<double>(truth_of(point, part));
      }
      const Point axis = part.b.normalized();
      const double along = axis.dot(x - part.a);
      return std::max(std::abs(along) - part.b.norm(),
                      (x - part.a - along * axis).norm() - part.radius);
    };
    EXPECT_LT(off(p, found.on_p), 1e-9) << i;
    EXPECT_LT(off(q, found.on_q), 1e-9) << i;
  }
}

struct Robot {
  std::vector<LinkGeometry> geometry;
  std::vector<test::TriangleGroups> groups;
  std::shared_ptr<const RobotModel> model;

  explicit Robot(std::vector<LinkGeometry> links)
      : geometry(std::move(links)), model(test::model_of(geometry, 0.02)) {
    for (const LinkGeometry& link : geometry) groups.emplace_back(test::triangles_of(link));
  }
  double surfaces_apart(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL) const {
    return groups[pair.first].distance(groups[pair.second],
                                       X_FL[pair.first].inverse() * X_FL[pair.second]);
  }
  // Whether a corner of one is inside the other.
  bool has_corner_inside(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL) const {
    const auto of = [&](std::size_t a, std::size_t b) {
      const Eigen::Isometry3d X_BA = X_FL[b].inverse() * X_FL[a];
      for (const auto& t : test::triangles_of(geometry[a])) {
        for (const Point& p : t.p) {
          if (test::oracle_signed_distance(geometry[b], X_BA * p) < -1e-9) return true;
        }
      }
      return false;
    };
    return of(pair.first, pair.second) || of(pair.second, pair.first);
  }
  bool are_closed(const LinkPair& pair) const {
    return model->links[pair.first].solid.is_closed() &&
           model->links[pair.second].solid.is_closed();
  }
  // Links with holes, and one that is inside out, need not have an inside where they touch.
  bool has_inside(std::size_t link) const {
    double volume = 0.0;
    for (const auto& t : test::triangles_of(geometry[link]))
      volume += t.p[0].dot(t.p[1].cross(t.p[2])) / 6.0;
    return volume > 0.0 && model->links[link].solid.is_closed();
  }
};

// Meshes and boxes of every kind, closed and open.
std::vector<LinkGeometry> mesh_links(test::Rng* rng) {
  std::vector<LinkGeometry> links;
  for (LinkGeometry& link : test::random_links(rng)) {
    const bool fits = std::all_of(link.begin(), link.end(), [](const GeometryElement& element) {
      return std::holds_alternative<TriangleMesh>(element.shape) ||
             std::holds_alternative<Box>(element.shape);
    });
    if (fits) links.push_back(std::move(link));
  }
  return links;
}

// What holds of links that are apart by the truth and told to be.
void expect_near(const PairProximity& r, double truth, double tolerance, const std::string& what) {
  EXPECT_EQ(r.state, LinkState::kNear) << what;
  EXPECT_LE(r.lower_bound, truth + 1e-14) << what;
  EXPECT_GE(r.distance, truth - 1e-14) << what;
  EXPECT_LE(r.distance, truth + tolerance + 1e-12) << what;
  if (r.lower_bound > 0.0) {
    EXPECT_LE(r.distance - r.lower_bound, tolerance + 1e-11) << what;
  }
}

// What holds of links whose surfaces touch, or of which one is inside the other.
void expect_contact(const PairProximity& r, double truth, bool are_closed,
                    const std::string& what) {
  EXPECT_LE(r.lower_bound, 0.0) << what;
  if (truth == 0.0 || are_closed) {
    EXPECT_LE(r.distance, 0.0) << what;
  }
}

struct Answers {
  int near = 0, contacts = 0, through_holes = 0;

  void expect(const Robot& robot, const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL,
              const PairProximity& r, double tolerance) {
    const double truth = robot.surfaces_apart(pair, X_FL);
    const std::string what = std::to_string(pair.first) + ", " + std::to_string(pair.second) +
                             " truth " + std::to_string(truth);
    if (truth == 0.0 || robot.has_corner_inside(pair, X_FL)) {
      expect_contact(r, truth, robot.are_closed(pair), what);
      contacts += r.state == LinkState::kContact ? 1 : 0;
      through_holes += truth > 0.0 ? 1 : 0;
    } else if (r.state == LinkState::kContact) {  // a face inside, through a hole
      EXPECT_FALSE(robot.are_closed(pair)) << what;
    } else {
      ++near;
      expect_near(r, truth, tolerance, what);
    }
  }
};

TEST(LinkPairExact, RandomMeshesAgainstBruteForce) {
  test::Rng rng(21);
  const Robot robot(mesh_links(&rng));
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < robot.geometry.size(); ++i) {
    for (std::size_t k = i + 1; k < robot.geometry.size(); ++k) pairs.push_back({i, k});
  }
  Answers answers;
  for (const double tolerance : {0.0, 0.001, 0.005}) {
    QueryConfig config;
    config.max_distance = 2.0;
    config.tolerance = tolerance;
    SelfQuery query(robot.model, pairs, config);
    std::vector<PairProximity> results;
    std::vector<Eigen::Isometry3d> X_FL(robot.geometry.size());
    for (int trial = 0; trial < test::scaled(12); ++trial) {
      SCOPED_TRACE("trial " + std::to_string(trial));
      for (auto& X : X_FL) X = test::random_pose(&rng, 0.2);
      ASSERT_TRUE(query.run(X_FL, std::vector<bool>(X_FL.size(), true), &results));
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        answers.expect(robot, pairs[i], X_FL, results[i], tolerance);
      }
    }
  }
  EXPECT_GT(answers.near, test::scaled(500));
  EXPECT_GT(answers.contacts, test::scaled(200));
  EXPECT_GT(answers.through_holes, test::kSanitized ? 0 : 5);
}

// What holds of a kept answer beside a fresh one. @param compares_touch  touching ones, too
void expect_same(const PairProximity& kept, const PairProximity& anew, double tolerance,
                 bool compares_touch, const std::string& what) {
  if (kept.distance <= 0.0 && anew.distance <= 0.0 && !compares_touch) return;
  ASSERT_EQ(kept.state, anew.state) << what << " " << kept.distance << " " << anew.distance;
  if (kept.state != LinkState::kNear) return;
  ASSERT_NEAR(kept.distance, anew.distance, tolerance + 1e-12) << what;
  ASSERT_LE(kept.lower_bound, anew.distance + 1e-13) << what;
  ASSERT_LE(anew.lower_bound, kept.distance + 1e-13) << what;
  if (kept.lower_bound > 0.0) {
    ASSERT_LE(kept.distance - kept.lower_bound, tolerance + 1e-11) << what;
  }
}

// Links that move and turn steadily.
struct Motion {
  std::vector<Eigen::Isometry3d> X_FL;
  std::vector<Point> velocity, turn;  // by a step

  Motion(std::size_t links, test::Rng* rng) : X_FL(links) {
    for (auto& X : X_FL) X = test::random_pose(rng, 0.2);
    for (std::size_t i = 0; i < links; ++i) {
      velocity.push_back(test::random_vector(rng, 1e-4));
      turn.push_back(test::random_vector(rng, 5e-4));
    }
  }
  void step() {
    for (std::size_t i = 0; i < X_FL.size(); ++i) {
      X_FL[i].translation() += velocity[i];
      X_FL[i].linear() *= Eigen::AngleAxisd(turn[i].norm(), turn[i].normalized()).matrix();
    }
  }
};

// The answers along a motion are those of a fresh query.
TEST(LinkPairExact, AMotionGivesTheAnswersOfFreshQueries) {
  test::Rng rng(22);
  const Robot robot(mesh_links(&rng));
  std::vector<LinkPair> pairs;
  for (std::size_t k = 1; k < robot.geometry.size(); ++k) pairs.push_back({k - 1, k});
  std::vector<bool> have_insides(pairs.size());
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    have_insides[k] = robot.has_inside(pairs[k].first) && robot.has_inside(pairs[k].second);
  }
  QueryConfig config;
  config.max_distance = 0.5;
  const std::vector<bool> known(robot.geometry.size(), true);
  for (const double tolerance : {0.0, 0.001}) {
    config.tolerance = tolerance;
    SelfQuery query(robot.model, pairs, config);
    std::vector<PairProximity> kept, anew;
    for (int i = 0; i < test::scaled(4); ++i) {
      Motion motion(robot.geometry.size(), &rng);
      for (int step = 0; step < 200; ++step) {
        motion.step();
        query.run(motion.X_FL, known, &kept);
        if (step % 3 != 0) continue;
        SelfQuery(robot.model, pairs, config).run(motion.X_FL, known, &anew);
        for (std::size_t k = 0; k < pairs.size(); ++k) {
          expect_same(kept[k], anew[k], tolerance, have_insides[k],
                      "pair " + std::to_string(k) + " step " + std::to_string(step));
          ASSERT_FALSE(HasFatalFailure());
        }
      }
    }
  }
}

// The path of a pair is measured anew after 100 m; what was proven before stays as it was. It
// counted as proven 100 m farther: bounds and distances were up to 9.5 mm too large from then on.
TEST(LinkPairExact, BoundsHoldHoweverFarLinksHaveMoved) {
  test::Rng rng(24);
  const auto model =
      test::make_model({test::torus(0.2, 0.03, 12, 6), test::l_shape(0.3, 0.06)}, 0.01);
  const std::vector<bool> known = {true, true};
  constexpr double kStep = 0.009;  // [m] shorter than a jump, which begins anew
  for (int trial = 0; trial < 6; ++trial) {
    SelfQuery query(model, {{0, 1}}, {});
    const Eigen::Isometry3d start =
        Eigen::Translation3d(0.0, 0.0, 0.3) * test::random_pose(&rng, 0.1);
    const Point way = test::random_vector(&rng, 1.0).normalized();
    const double reach = test::uniform(&rng, 0.05, 0.15);
    std::vector<PairProximity> kept, anew;
    for (int i = 0; i < 14000; ++i) {
      std::vector<Eigen::Isometry3d> X_FL = {Eigen::Isometry3d::Identity(), start};
      X_FL[1].translation() += reach * std::sin(kStep / reach * i) * way;
      query.run(X_FL, known, &kept);
      if (i < 10000 || i % 5 != 0) continue;
      SelfQuery(model, {{0, 1}}, {}).run(X_FL, known, &anew);
      expect_same(kept[0], anew[0], QueryConfig().tolerance, false,
                  "trial " + std::to_string(trial) + " step " + std::to_string(i));
      ASSERT_FALSE(HasFatalFailure());
    }
  }
}

// A deadline that is over at once leaves bounds that hold.
TEST(LinkPairExact, EveryPairHasABoundWhenTheTimeIsOver) {
  test::Rng rng(23);
  const Robot robot(mesh_links(&rng));
  std::vector<LinkPair> pairs;
  for (std::size_t k = 1; k < robot.geometry.size(); ++k) pairs.push_back({k - 1, k});
  QueryConfig config, hurried;
  config.max_distance = hurried.max_distance = 0.5;
  config.tolerance = hurried.tolerance = 0.0;
  hurried.deadline = 1e-9;
  SelfQuery exact(robot.model, pairs, config), query(robot.model, pairs, hurried);
  std::vector<PairProximity> truth, answer;
  std::vector<Eigen::Isometry3d> X_FL(robot.geometry.size());
  int unfinished = 0;
  for (int trial = 0; trial < 200; ++trial) {
    for (auto& X : X_FL) {
      X = trial % 5 == 0
              ? test::random_pose(&rng, 0.3)
              : Eigen::Isometry3d(X * Eigen::Translation3d(test::random_vector(&rng, 1e-3)));
    }
    exact.run(X_FL, std::vector<bool>(X_FL.size(), true), &truth);
    const bool all = query.run(X_FL, std::vector<bool>(X_FL.size(), true), &answer);
    EXPECT_FALSE(all);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      unfinished += answer[i].finished ? 0 : 1;
      if (truth[i].state == LinkState::kUnknown) continue;
      ASSERT_LE(answer[i].lower_bound, truth[i].distance + 1e-13) << i << " trial " << trial;
      ASSERT_NE(answer[i].state, LinkState::kClear) << i;
    }
  }
  EXPECT_GT(unfinished, 1000);
}

// The visual meshes of the Panda, most of which have holes.
TEST(LinkPairExact, PandaAgainstBruteForce) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const RobotDescription description = test::read_panda(*data, GeometrySource::kVisual);
  RobotModelConfig packing;
  packing.packing.max_error = 0.02;
  const auto model = build_robot_model(description, packing);
  const Kinematics kinematics(description);
  const std::vector<LinkPair> pairs =
      self_collision_pairs(*model, kinematics, std::vector<bool>(model->links.size(), true), {});
  std::vector<test::TriangleGroups> groups;
  ASSERT_EQ(model->links.size(), 11U);
  for (const LinkModel& link : model->links) {
    ASSERT_TRUE(link.usable()) << link.error;
    EXPECT_TRUE(link.packing.certificate.reached) << link.name;
    EXPECT_LE(link.packing.certificate.max_gap, packing.packing.max_error) << link.name;
    const auto found = std::find_if(description.links.begin(), description.links.end(),
                                    [&](const LinkDescription& l) { return l.name == link.name; });
    groups.emplace_back(test::triangles_of(found->geometry));
  }
  test::Rng rng(24);
  QueryConfig config;
  config.max_distance = 10.0;
  SelfQuery query(model, pairs, config);
  std::vector<PairProximity> results;
  const std::vector<double> tolerances = {0.0, 0.001, 0.005};
  int near = 0;
  for (int i = 0; i < (test::kSanitized ? 1 : 6); ++i) {
    std::vector<double> q;
    for (const auto& joint : kinematics.joints()) {
      q.push_back(joint.is_free() ? test::uniform(&rng, joint.lower, joint.upper) : 0.0);
    }
    const LinkPoses poses = link_poses(*model, kinematics, q);
    config.tolerance = tolerances[static_cast<std::size_t>(i) % 3];
    query.set_config(config);
    query.run(poses.X_FL, poses.known, &results);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const PairProximity& r = results[k];
      const double truth = groups[pairs[k].first].distance(
          groups[pairs[k].second],
          poses.X_FL[pairs[k].first].inverse() * poses.X_FL[pairs[k].second]);
      if (truth == 0.0) EXPECT_EQ(r.state, LinkState::kContact) << k;
      if (r.state != LinkState::kNear) continue;
      ++near;
      EXPECT_LE(r.lower_bound, truth + 1e-14) << k;
      EXPECT_GE(r.distance, truth - 1e-14) << k;
      EXPECT_LE(r.distance - r.lower_bound, config.tolerance + 1e-5) << k;
    }
  }
  EXPECT_GT(near, 30);
}

}  // namespace
}  // namespace ist
