#include "support/scene.h"

#include <cstdint>
#include <string>

#include "internal/packing/packer.h"
#include "support/sanitizers.h"

namespace ist::test {

double uniform(Rng* rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*rng);
}

Eigen::Vector3d random_vector(Rng* rng, double size) {
  return {uniform(rng, -size, size), uniform(rng, -size, size), uniform(rng, -size, size)};
}

Eigen::Isometry3d random_pose(Rng* rng, double size) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond q(normal(*rng), normal(*rng), normal(*rng), normal(*rng));
  X.linear() = q.normalized().toRotationMatrix();
  X.translation() = random_vector(rng, size);
  return X;
}

LinkModel make_link(const Shape& shape, double max_error) {
  LinkModel link;
  PackingConfig config;
  config.max_error = packed_to(max_error);
  link.packing = pack_element(shape, config);
  link.tree = InnerSphereTree(link.packing);
  link.solid = Solid({GeometryElement{shape, Eigen::Isometry3d::Identity(), "test"}});
  return link;
}

std::shared_ptr<RobotModel> make_model(const std::vector<Shape>& shapes, double max_error) {
  auto model = std::make_shared<RobotModel>();
  for (const Shape& shape : shapes) {
    model->links.push_back(make_link(shape, max_error));
    model->links.back().name = "link" + std::to_string(model->links.size() - 1);
  }
  return model;
}

CloudSnapshot make_snapshot(const std::vector<Eigen::Vector3d>& points_F,
                            const Eigen::Vector3d& origin) {
  std::vector<float> x, y, z;
  std::vector<std::uint32_t> id;
  for (const Eigen::Vector3d& p : points_F) {
    id.push_back(static_cast<std::uint32_t>(id.size()));
    x.push_back(static_cast<float>(p.x() - origin.x()));
    y.push_back(static_cast<float>(p.y() - origin.y()));
    z.push_back(static_cast<float>(p.z() - origin.z()));
  }
  CloudSnapshot snapshot;
  snapshot.index.build(origin, x.data(), y.data(), z.data(), id.data(), x.size());
  snapshot.counts.received = snapshot.counts.used = static_cast<std::uint32_t>(x.size());
  return snapshot;
}

}  // namespace ist::test
