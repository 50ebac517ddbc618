// What one thread proves with a new cloud, and another one goes on from.

#include "internal/repulsion/coherent_queries.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/cloud/ingest.h"
#include "support/distance_fields.h"
#include "support/images.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::Image;

// Links that move before a wall, of which images come; the truth is brute force.
class CoherentQueriesTest : public ::testing::Test {
 protected:
  CoherentQueriesTest()
      : meshes_{test::l_shape(0.2, 0.05), test::open_box({0.1, 0.1, 0.15})},
        model_(std::make_shared<RobotModel>(
            *test::with_fields(test::make_model({meshes_[0], meshes_[1]}, 0.005)))),
        X_FL_{test::random_pose(&rng_, 0.0), test::random_pose(&rng_, 0.0)} {
    X_FL_[0].translation() = Eigen::Vector3d(-0.1, 0.0, 0.8);
    X_FL_[1].translation() = Eigen::Vector3d(0.15, 0.05, 0.95);
  }

  void see() {
    images_.push_back(std::make_unique<Image>(test::wall(160, 120, 0.001, &rng_)));
    IngestConfig config;
    config.min_range = 0.0;
    Ingest(config).run(images_.back()->raw(), Eigen::Isometry3d::Identity(), {}, 0.0, &cloud_);
  }
  void move() {
    for (Eigen::Isometry3d& X : X_FL_) {
      X.pretranslate(Eigen::Vector3d(2e-4, 1e-4, 0.0));
      X.rotate(Eigen::AngleAxisd(1e-3, Eigen::Vector3d::UnitY()));
    }
  }
  void warm_up(CoherentQueries* queries, double limit = 10.0) {
    queries->warm_up(X_FL_, {true, true}, {&cloud_}, {}, {}, limit);
  }

  void run(CoherentQueries* queries) {
    queries->query().set_config({});
    queries->query().run(X_FL_, {true, true}, {&cloud_}, &results_);
  }

  void expect_true_answers() {
    const Image& image = *images_.back();
    for (std::size_t link = 0; link < results_.size(); ++link) {
      std::vector<Eigen::Vector3d> points_L;
      for (std::size_t i = 0; i < image.size(); ++i) {
        points_L.push_back(X_FL_[link].inverse() * image.point(i));
      }
      const double exact = test::oracle_minimum(meshes_[link], points_L);
      EXPECT_LE(results_[link].lower_bound, exact + 1e-9) << link;
      EXPECT_GE(results_[link].distance, exact - 1e-6) << link;
      EXPECT_LE(results_[link].distance, exact + QueryConfig().tolerance + 2e-6) << link;
    }
  }

  test::Rng rng_{7};
  std::vector<TriangleMesh> meshes_;
  std::shared_ptr<RobotModel> model_;
  std::vector<Eigen::Isometry3d> X_FL_;
  std::vector<std::unique_ptr<Image>> images_;
  CloudSnapshot cloud_;
  std::vector<LinkProximity> results_;
};

TEST_F(CoherentQueriesTest, RepelFromTheNewCloud) {
  CoherentQueries queries(model_, QueryConfig());
  for (int image = 0; image < 5; ++image) {
    see();
    warm_up(&queries);
    move();
    run(&queries);
    for (std::size_t link = 0; link < results_.size(); ++link) {
      // What is kept is there at once.
      EXPECT_TRUE(queries.repel(link, X_FL_[link], {&cloud_}, results_[link], {}, TimePoint::min())
                      .force.allFinite());
      const RepulsiveWrench truth =
          queries.repulsion().wrench(link, X_FL_[link], {&cloud_}, results_[link], {});
      const RepulsiveWrench kept = queries.repel(link, X_FL_[link], {&cloud_}, results_[link], {});
      EXPECT_GT(truth.force.norm(), 0.0);
      EXPECT_LT((kept.force - truth.force).norm(), 0.01 * truth.force.norm());
    }
  }
}

// A warm-up that time ends at any step leaves nothing behind that is wrong.
TEST_F(CoherentQueriesTest, MayBeCutShort) {
  see();
  CoherentQueries queries(model_, QueryConfig());
  for (std::int64_t asks = 0; asks < 3000; asks += 1 + asks / 8) {
    see();
    Deadline::asks_left_for_test = asks;
    warm_up(&queries);
    Deadline::asks_left_for_test = -1;
    move();
    run(&queries);
    expect_true_answers();
    for (std::size_t link = 0; link < results_.size(); ++link) {
      EXPECT_TRUE(
          queries.repel(link, X_FL_[link], {&cloud_}, results_[link], {}).force.allFinite());
    }
  }
}

TEST_F(CoherentQueriesTest, TakeAnotherPackingOfTheSameLinks) {
  const std::shared_ptr<RobotModel> finer = test::make_model({meshes_[0], meshes_[1]}, 0.002);
  finer->geometry_id = model_->geometry_id = 1;
  CoherentQueries queries(model_, QueryConfig());
  for (int image = 0; image < 4; ++image) {
    see();
    warm_up(&queries);
    const std::shared_ptr<const RobotModel> next = image % 2 == 0 ? finer : model_;
    queries.set_model(next, Repulsion(next));
    EXPECT_EQ(queries.model(), next);
    EXPECT_EQ(&queries.query().model(), next.get());
    run(&queries);
    for (std::size_t link = 0; link < results_.size(); ++link) {
      const RepulsiveWrench truth =
          Repulsion(next).wrench(link, X_FL_[link], {&cloud_}, results_[link], {});
      EXPECT_EQ(queries.repel(link, X_FL_[link], {&cloud_}, results_[link], {}).force, truth.force);
    }
    move();
    run(&queries);
    expect_true_answers();
  }
}

TEST_F(CoherentQueriesTest, WithoutCloudsOrPosesNothingIsKnown) {
  CoherentQueries queries(model_, QueryConfig());
  queries.warm_up(X_FL_, {true, true}, {}, {}, {}, 1.0);
  see();
  queries.warm_up(X_FL_, {false, false}, {&cloud_}, {}, {}, 1.0);
  queries.warm_up({}, {}, {&cloud_}, {}, {}, 1.0);
  run(&queries);
  expect_true_answers();
}

}  // namespace
}  // namespace ist
