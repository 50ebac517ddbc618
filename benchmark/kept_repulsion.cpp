// How far off the repulsion vector is that follows a link between blends: the Panda's motion among
// the recorded Kinect frames, an image each 33 ms and poses each millisecond, as the node has them.
// Compared with the same mean over all pairs of spheres and thinned points, in double, at the pose.
// A table for doc/accuracy.md.
//
// Usage: kept_repulsion CACHE_FOLDER [DOCUMENT]; scripts/benchmark --repulsion calls it. Needs the
// test data: IST_PROXIMITY_DATA, or ../shared/data.

#include "ist_proximity/repulsion/kept_repulsion.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/scene.h"
#include "repulsion/coarse_spheres.h"
#include "support.h"
#include "support/data_dir.h"
#include "support/tiles.h"

namespace {

using ist::CloudSnapshot;
using ist::InnerSphere;
using ist::LinkProximity;
using ist::benchmark::DataSet;
using ist::benchmark::quantile;
using ist::benchmark::Scene;
using Poses = std::vector<Eigen::Isometry3d>;

constexpr std::size_t kCycles = 33;        // at 1 kHz, between two images at 30 Hz
constexpr std::size_t kImagesBetween = 4;  // of the motion's images, one in so many is taken
constexpr std::size_t kCompared = 5;       // one cycle in so many is compared

struct WeightedPoint {
  Eigen::Vector3d p_FQ;
  double weight;
};

std::vector<WeightedPoint> weighted_points(const CloudSnapshot& cloud) {
  std::vector<WeightedPoint> points;
  for (const ist::ThinnedTile& tile : ist::test::thinned_tiles_of(cloud.index)) {
    for (int k = 0; k < tile.count; ++k) {
      points.push_back({cloud.index.X_FO() * tile.point(k), static_cast<double>(tile.weight[k])});
    }
  }
  return points;
}

// The mean direction over all pairs, times the length.
Eigen::Vector3d pair_by_pair(const std::vector<InnerSphere>& spheres, const Eigen::Isometry3d& X_FL,
                             const std::vector<WeightedPoint>& points, double smoothing,
                             double length) {
  Eigen::Matrix3Xd centers(3, static_cast<Eigen::Index>(spheres.size()));
  Eigen::RowVectorXd radii(centers.cols());
  for (Eigen::Index i = 0; i < centers.cols(); ++i) {
    const InnerSphere& sphere = spheres[static_cast<std::size_t>(i)];
    centers.col(i) = X_FL * sphere.center;
    radii[i] = sphere.radius;
  }
  std::vector<double> distances;
  distances.reserve(points.size());
  double nearest = std::numeric_limits<double>::infinity();
  for (const WeightedPoint& point : points) {
    const auto lengths = (centers.colwise() - point.p_FQ).colwise().norm();
    distances.push_back((lengths - radii).minCoeff());
    nearest = std::min(nearest, distances.back());
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0.0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (distances[k] >= nearest + smoothing) continue;
    for (Eigen::Index i = 0; i < centers.cols(); ++i) {
      const Eigen::Vector3d offset = centers.col(i) - points[k].p_FQ;
      const double d = offset.norm() - radii[i];
      const double root = std::max(1.0 - (d - nearest) / smoothing, 0.0);
      const double w = points[k].weight * root * root;
      sum += w * offset.normalized();
      weights += w;
    }
  }
  return length / weights * sum;
}

// Errors are lengths of differences, of the gain.
struct Measured {
  std::vector<double> kept, anew;  // of the vector as it is kept, and blended anew at the pose
  std::size_t updates = 0;
};

// The vectors of a robot from cycle to cycle, and what they should be.
class Comparison {
 public:
  explicit Comparison(const std::shared_ptr<const ist::RobotModel>& model)
      : model_(model), known_(model->links.size(), true), query_(model, {}), repulsion_(model) {
    for (std::size_t i = 0; i < model->links.size(); ++i) {
      kept_.emplace_back(i);
      spheres_.push_back(ist::coarse_spheres(model->links[i].packing, ist::kCoarseSpheres));
    }
  }

  void ingest(const ist::benchmark::Frame& frame, const Poses& X_FL) {
    ingest_.run(frame.raw(), frame.X_FS, ist::posed_solids(*model_, X_FL, known_), 0.0, &snapshot_);
    points_ = weighted_points(snapshot_);
  }

  void cycle(const Poses& X_FL, bool compare, Measured* measured) {
    query_.run(X_FL, known_, {&snapshot_}, &results_);
    for (std::size_t i = 0; i < results_.size(); ++i) {
      const double length = config_.gain * ist::repulsion_strength(results_[i], config_);
      if (!(length > 0.0)) continue;
      const Eigen::Vector3d kept =
          kept_[i].update(repulsion_, X_FL[i], {&snapshot_}, results_[i], config_).force;
      ++measured->updates;
      if (!compare) continue;
      const Eigen::Vector3d anew =
          repulsion_.wrench(i, X_FL[i], {&snapshot_}, results_[i], config_).force;
      const Eigen::Vector3d exact =
          pair_by_pair(spheres_[i], X_FL[i], points_, config_.smoothing, length);
      measured->kept.push_back((kept - exact).norm() / config_.gain);
      measured->anew.push_back((anew - exact).norm() / config_.gain);
    }
  }

 private:
  std::shared_ptr<const ist::RobotModel> model_;
  std::vector<bool> known_;
  ist::Ingest ingest_{ist::IngestConfig()};
  CloudSnapshot snapshot_;
  ist::ProximityQuery query_;
  ist::Repulsion repulsion_;
  ist::RepulsionConfig config_;
  std::vector<ist::KeptRepulsion> kept_;
  std::vector<std::vector<InnerSphere>> spheres_;
  std::vector<WeightedPoint> points_;
  std::vector<LinkProximity> results_;
};

Measured measure(const DataSet& set, const Scene& scene,
                 const std::shared_ptr<const ist::RobotModel>& model) {
  Measured measured;
  Comparison comparison(model);
  for (std::size_t begin = 0; begin + kCycles <= set.motion.size();
       begin += kImagesBetween * kCycles) {
    comparison.ingest(scene.frame, set.motion[begin]);
    for (std::size_t k = 0; k < kCycles; ++k) {
      comparison.cycle(set.motion[begin + k], k % kCompared == 0, &measured);
    }
  }
  return measured;
}

std::string row(const std::string& name, const Measured& measured) {
  std::string cells = "| " + name + " | " + std::to_string(measured.kept.size());
  for (const std::vector<double>* errors : {&measured.kept, &measured.anew}) {
    for (const double q : {0.5, 0.99, 1.0}) {
      char cell[32];
      std::snprintf(cell, sizeof cell, " | %.3f", 100.0 * quantile(*errors, q));
      cells += cell;
    }
  }
  return cells + " |\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "Usage: kept_repulsion CACHE_FOLDER [DOCUMENT]\n");
    return 2;
  }
  const auto data = ist::test::data_dir();
  if (!data) {
    std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
    return 0;
  }
  const DataSet set = ist::benchmark::kinect_data(*data, argv[1]);
  const auto model = set.robot.pack(ist::PackingConfig().max_error);
  std::string table =
      "| frame | vectors | kept: median [%] | p99 [%] | largest [%] | blended anew: median [%] | "
      "p99 [%] | largest [%] |\n|---|---|---|---|---|---|---|---|\n";
  for (const Scene& scene : set.scenes) table += row(scene.name, measure(set, scene, model));
  std::printf("%s", table.c_str());
  if (argc < 3) return 0;
  return ist::benchmark::write_table(argv[2], "kept", table) ? 0 : 1;
}
