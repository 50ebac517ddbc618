#include <fcl/fcl.h>

#include "link_pairs/peers.h"

namespace ist::benchmark {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

class Fcl : public PairPeer {
 public:
  Fcl(std::vector<LinkPair> pairs, std::vector<std::shared_ptr<const Model>> models, bool is_warm)
      : pairs_(std::move(pairs)),
        models_(std::move(models)),
        is_warm_(is_warm),
        last_(pairs_.size()) {}

  std::string name() const override { return is_warm_ ? "FCL, to 1 mm, warm" : "FCL, exact"; }
  double tolerance() const override { return is_warm_ ? 0.001 : 0.0; }
  bool is_warm() const override { return is_warm_; }

  void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) override {
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      fcl::DistanceResultd result;
      // Never more than what the last answer's triangles have at these poses.
      if (is_warm_ && last_[k].min_distance < 1e9) {
        result.b1 = last_[k].b1;
        result.b2 = last_[k].b2;
        result.min_distance = of_triangles(pairs_[k], X_FL, last_[k]) * (1.0 + 1e-9) + 1e-12;
      }
      distance(pairs_[k], X_FL, &result);
      (*distances)[k] = result.min_distance;
      last_[k] = result;
    }
  }

 private:
  void distance(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL,
                fcl::DistanceResultd* result) const {
    fcl::DistanceRequestd request;
    request.enable_nearest_points = true;
    request.abs_err = tolerance();
    request.rel_err = is_warm_ ? 1e9 : 0.0;  // both errors have to be met
    fcl::distance(models_[pair.first].get(), X_FL[pair.first], models_[pair.second].get(),
                  X_FL[pair.second], request, *result);
  }

  double of_triangles(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL,
                      const fcl::DistanceResultd& at) const {
    fcl::Vector3d t[2][3], p, q;
    const std::size_t links[2] = {pair.first, pair.second};
    const std::intptr_t numbers[2] = {at.b1, at.b2};
    for (int side = 0; side < 2; ++side) {
      const Model& model = *models_[links[side]];
      for (std::size_t k = 0; k < 3; ++k) {
        t[side][k] = X_FL[links[side]] * model.vertices[model.tri_indices[numbers[side]][k]];
      }
    }
    return fcl::detail::TriangleDistance<double>::triDistance(t[0], t[1], p, q);
  }

  std::vector<LinkPair> pairs_;
  std::vector<std::shared_ptr<const Model>> models_;
  bool is_warm_;
  std::vector<fcl::DistanceResultd> last_;  // by pair
};

}  // namespace

std::vector<std::unique_ptr<PairPeer>> fcl_peers(const Robot& robot) {
  std::vector<std::shared_ptr<const Model>> models;
  for (const auto& triangles : robot.triangles) {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<fcl::Triangle> faces;
    for (const auto& t : triangles) {
      const std::size_t first = vertices.size();
      vertices.insert(vertices.end(), t.p, t.p + 3);
      faces.emplace_back(first, first + 1, first + 2);
    }
    const auto model = std::make_shared<Model>();
    model->beginModel();
    model->addSubModel(vertices, faces);
    model->endModel();
    models.push_back(model);
  }
  std::vector<std::unique_ptr<PairPeer>> peers;
  for (const bool is_warm : {false, true}) {
    peers.push_back(std::make_unique<Fcl>(robot.pairs, models, is_warm));
  }
  return peers;
}

}  // namespace ist::benchmark
