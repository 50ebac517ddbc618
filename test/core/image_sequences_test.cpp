// Random sequences of images, maps, poses and questions: whatever a query keeps, no lower bound is
// above the truth by brute force. With --gtest_repeat each repetition has a seed of its own.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "internal/proximity/deadline.h"
#include "internal/repulsion/coherent_queries.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/images.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kBoxes = 24;  // of a map, at most

// One snapshot, what it was made of, and the points that are in it.
struct Source {
  test::Image image;  // tiles are read from it
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> points;  // [m] fixed frame
  std::vector<Eigen::AlignedBox3d> boxes;
  CloudSnapshot cloud;
};
using SourcePtr = std::shared_ptr<Source>;

class ImageSequences : public ::testing::Test {
 protected:
  ImageSequences() : rng_(next_seed()) {
    meshes_ = {test::l_shape(0.2, 0.05), test::open_box({0.1, 0.1, 0.15})};
    model_ = test::make_model({meshes_[0], meshes_[1]}, 0.005);
    X_FL_ = {test::random_pose(&rng_, 0.0), test::random_pose(&rng_, 0.0)};
    X_FL_[0].translation() = Eigen::Vector3d(-0.1, 0.0, 0.8);
    X_FL_[1].translation() = Eigen::Vector3d(0.15, 0.05, 0.9);
    config_.max_distance = 3.0;
  }
  ~ImageSequences() override { Deadline::asks_left_for_test = -1; }

  static std::uint64_t next_seed() {
    static std::uint64_t seed = 181;
    return seed++;
  }
  double uniform(double low, double high) { return test::uniform(&rng_, low, high); }
  bool happens(double probability) { return uniform(0.0, 1.0) < probability; }
  // From the one to the other, evenly among their powers of ten.
  double any_scale(double low, double high) {
    return std::pow(10.0, uniform(std::log10(low), std::log10(high)));
  }

  // Boxes that stay, come, go, and change their sizes at the same index.
  std::vector<Eigen::AlignedBox3d> next_boxes(const Source* last) {
    std::vector<Eigen::AlignedBox3d> boxes;
    for (std::size_t k = 0; k < kBoxes; ++k) {
      if (happens(0.2)) continue;
      const bool stays = last != nullptr && last->boxes.size() > k && happens(0.9);
      Eigen::Vector3d center(0.0, 0.0, 0.85);
      if (stays) {
        center = last->boxes[k].center();
      } else {
        center += test::random_vector(&rng_, 0.4);
      }
      const Eigen::Vector3d half = Eigen::Vector3d::Constant(uniform(0.002, 0.02));
      boxes.emplace_back(center - half, center + half);
    }
    return boxes;
  }

  // An image of a still scene, or of any size; pixels appear, vanish and jump, and may come as a
  // list in another order.
  test::Image next_pixels(const Source* last) {
    const bool is_same = last != nullptr && last->image.height > 1 && happens(0.6);
    const std::size_t width = is_same ? last->image.width : 8 + rng_() % 24;
    const std::size_t height = is_same ? last->image.height : 8 + rng_() % 16;
    test::Image image =
        test::wall(width, height, happens(0.2) ? 0.0 : any_scale(1e-4, 5e-3), &rng_);
    const double lost = happens(0.5) ? 0.0 : uniform(0.0, 0.9);
    for (std::size_t i = 0; i < image.size(); ++i) {
      if (happens(lost)) {
        image.at(i).setConstant(std::numeric_limits<float>::quiet_NaN());
      } else if (happens(0.01)) {
        const Eigen::Vector3d jump(0.0, 0.0, 0.85);
        image.at(i) = (jump + test::random_vector(&rng_, 0.3)).cast<float>();
      }
    }
    if (happens(0.15)) {
      for (std::size_t k = image.size() - 1; k > 0; --k)
        image.at(k).swap(image.at(rng_() % (k + 1)));
      image.width = image.size();
      image.height = 1;
    }
    return image;
  }

  // The sensor stands still, drifts, or is somewhere else.
  Eigen::Isometry3d next_sensor(const Source* last) {
    if (last == nullptr || happens(0.1)) {
      return Eigen::Isometry3d(Eigen::Translation3d(test::random_vector(&rng_, 0.1)));
    }
    if (happens(0.5)) return last->X_FS;
    const double step = any_scale(1e-5, 2e-2);
    Eigen::Isometry3d X_FS = last->X_FS;
    X_FS.rotate(Eigen::AngleAxisd(step, test::random_vector(&rng_, 1.0).normalized()));
    X_FS.pretranslate(test::random_vector(&rng_, step));
    return X_FS;
  }

  PointExtent next_extent(const Eigen::Vector3d& p_FS) {
    PointExtent extent;
    if (happens(0.6)) return extent;
    extent.constant = happens(0.5) ? 0.0 : uniform(0.0, 0.03);
    extent.linear = happens(0.5) ? 0.0 : uniform(0.0, 0.05);
    extent.quadratic = happens(0.5) ? 0.0 : uniform(0.0, 0.02);
    extent.max_range = 3.0;
    extent.p_FS = p_FS;
    return extent;
  }

  SourcePtr next_source(const Source* last) {
    auto source = std::make_shared<Source>();
    if (happens(last != nullptr && !last->boxes.empty() ? 0.7 : 0.25)) {
      source->boxes = next_boxes(last);
      source->cloud = test::make_map(source->boxes, Eigen::Isometry3d::Identity());
      if (!source->boxes.empty()) return source;
    }
    source->image = next_pixels(last);
    source->X_FS = next_sensor(last);
    for (std::size_t i = 0; i < source->image.size(); ++i) {
      const Eigen::Vector3d p_SQ = source->image.point(i);
      if (p_SQ.allFinite()) source->points.push_back(source->X_FS * p_SQ);
    }
    IngestConfig config;
    config.min_range = 0.0;
    Ingest(config).run(source->image.raw(), source->X_FS, {}, 0.0, &source->cloud);
    source->cloud.extent = next_extent(source->X_FS.translation());
    with_extent_ += source->cloud.extent.is_zero() ? 0 : 1;
    return source;
  }

  void begin() {
    used_.clear();
    for (int i = 0; i < 3; ++i) used_.push_back(next_source(nullptr));
    known_ = used_;
  }
  // One source at a time: it gets its next image, or one that was there before.
  void change_sources() {
    SourcePtr& replaced = used_[rng_() % used_.size()];
    if (happens(0.25)) {
      known_.push_back(next_source(replaced.get()));
      replaced = known_.back();
    } else if (happens(0.2)) {
      replaced = known_[rng_() % known_.size()];
    }
  }

  void change_question() {
    config_.tolerance = happens(0.5) ? 0.0 : any_scale(1e-4, 3e-2);
    config_.max_distance = any_scale(1e-2, 2.0);
    config_.margin = happens(0.5) ? 0.0 : uniform(0.0, 0.01);
  }

  // Slow, and sometimes sudden.
  void move() {
    const double step = happens(0.1) ? 0.1 : any_scale(1e-5, 1e-2);
    for (Eigen::Isometry3d& X : X_FL_) {
      X.translation() += test::random_vector(&rng_, step);
      X.rotate(Eigen::AngleAxisd(step, test::random_vector(&rng_, 1.0).normalized()));
    }
  }

  // [m] The least signed distance of the spheres that points stand for, and of boxes.
  double truth(std::size_t link) const {
    const Eigen::Isometry3d X_LF = X_FL_[link].inverse();
    double truth = kInfinity;
    const test::BoxOracle oracle(meshes_[link]);
    for (const SourcePtr& source : used_) {
      const PointExtent& extent = source->cloud.extent;
      for (const Eigen::Vector3d& p_F : source->points) {
        const double radius = extent.radius((p_F - extent.p_FS).norm());
        truth = std::min(truth, test::oracle_signed_distance(meshes_[link], X_LF * p_F) - radius);
      }
      for (const Eigen::AlignedBox3d& box : source->boxes) {
        truth = std::min(truth, oracle.distance({box, X_LF}));
      }
    }
    return truth;
  }

  // Asks, some questions with a deadline that passes after some looks at the clock.
  void ask_and_check(ProximityQuery* query) {
    QueryConfig config = config_;
    const bool has_deadline = happens(0.3);
    config.deadline = has_deadline ? 1.0 : 0.0;
    query->set_config(config);
    std::vector<const CloudSnapshot*> clouds;
    for (const SourcePtr& source : used_) clouds.push_back(&source->cloud);
    std::vector<LinkProximity> results;
    Deadline::asks_left_for_test =
        has_deadline ? static_cast<std::int64_t>(any_scale(1.0, 2000.0)) - 1 : -1;
    const bool is_complete =
        query->run(X_FL_, {true, true}, {clouds.data(), clouds.size()}, &results);
    Deadline::asks_left_for_test = -1;
    ASSERT_TRUE(is_complete || has_deadline);
    unfinished_ += is_complete ? 0 : 1;
    for (std::size_t link = 0; link < results.size(); ++link) {
      ASSERT_TRUE(results[link].state != LinkState::kUnknown || !is_complete);
      ASSERT_LE(results[link].lower_bound, truth(link) - config_.margin + 1e-9);
      ++answers_[static_cast<std::size_t>(results[link].state)];
    }
  }

  // Makes a first answer with the present sources, to be stopped after some looks at the clock.
  void warm_up(CoherentQueries* queries) {
    std::vector<const CloudSnapshot*> clouds;
    for (const SourcePtr& source : used_) clouds.push_back(&source->cloud);
    Deadline::asks_left_for_test =
        happens(0.5) ? static_cast<std::int64_t>(any_scale(1.0, 2000.0)) - 1 : 1000000;
    queries->warm_up(X_FL_, {happens(0.9), happens(0.9)}, {clouds.data(), clouds.size()}, config_,
                     {}, 1.0);
    Deadline::asks_left_for_test = -1;
  }

  test::Rng rng_;
  std::vector<TriangleMesh> meshes_;
  std::shared_ptr<RobotModel> model_;
  std::vector<Eigen::Isometry3d> X_FL_;
  QueryConfig config_;
  std::vector<SourcePtr> known_, used_;
  // Of all repetitions: one seed alone may miss a state.
  static inline std::array<int, 4> answers_{};  // by state
  static inline int unfinished_ = 0, with_extent_ = 0;
};

TEST_F(ImageSequences, NoBoundIsAboveTheTruth) {
  for (int run = 0; run < test::scaled(4); ++run) {
    ProximityQuery query(model_, config_);
    begin();
    for (int step = 0; step < 50; ++step) {
      SCOPED_TRACE(::testing::Message() << "run " << run << ", step " << step);
      change_sources();
      if (happens(0.15)) change_question();
      move();
      ask_and_check(&query);
      if (HasFatalFailure()) return;
    }
  }
  if (test::kSanitized) return;  // too few cases to meet every state
  for (const LinkState state : {LinkState::kClear, LinkState::kNear, LinkState::kContact}) {
    EXPECT_GT(answers_[static_cast<std::size_t>(state)], 0);
  }
  EXPECT_GT(unfinished_, 0);
  EXPECT_GT(with_extent_, 0);
}

// The same where first answers are made beside, and what they prove is exchanged at any time.
TEST_F(ImageSequences, NoBoundIsAboveTheTruthAfterAWarmUp) {
  for (int run = 0; run < test::scaled(4); ++run) {
    auto own = std::make_unique<CoherentQueries>(model_, config_);
    auto spare = std::make_unique<CoherentQueries>(model_, config_);
    begin();
    for (int step = 0; step < 50; ++step) {
      SCOPED_TRACE(::testing::Message() << "run " << run << ", step " << step);
      change_sources();
      if (happens(0.4)) warm_up(spare.get());
      if (happens(0.3)) own.swap(spare);
      if (happens(0.1)) change_sources();
      if (happens(0.15)) change_question();
      move();
      ask_and_check(&own->query());
      if (HasFatalFailure()) return;
    }
  }
}

}  // namespace
}  // namespace ist
