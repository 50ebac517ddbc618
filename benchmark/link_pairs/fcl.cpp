#include <fcl/fcl.h>

#include "link_pairs/peers.h"

namespace ist::benchmark {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

class Fcl : public PairPeer {
 public:
  Fcl(std::vector<LinkPair> pairs, std::vector<std::shared_ptr<const Model>> models)
      : pairs_(std::move(pairs)), models_(std::move(models)) {}

  std::string name() const override { return "FCL, exact"; }

  void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) override {
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      fcl::DistanceResultd result;
      distance(pairs_[k], X_FL, &result);
      (*distances)[k] = result.min_distance;
    }
  }

 private:
  void distance(const LinkPair& pair, const std::vector<Eigen::Isometry3d>& X_FL,
                fcl::DistanceResultd* result) const {
    fcl::DistanceRequestd request;
    request.enable_nearest_points = true;
    fcl::distance(models_[pair.first].get(), X_FL[pair.first], models_[pair.second].get(),
                  X_FL[pair.second], request, *result);
  }

  std::vector<LinkPair> pairs_;
  std::vector<std::shared_ptr<const Model>> models_;
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
  peers.push_back(std::make_unique<Fcl>(robot.pairs, models));
  return peers;
}

}  // namespace ist::benchmark
