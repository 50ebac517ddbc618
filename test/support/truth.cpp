#include "support/truth.h"

#include <Eigen/Core>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "internal/geometry/mesh_io.h"
#include "support/data_dir.h"
#include "support/npy.h"
#include "support/pcd.h"
#include "support/sanitizers.h"

namespace ist::test {

const char* panda_mesh(std::size_t link) {
  constexpr const char* kNames[kPandaLinks] = {"link0", "link1",  "link2", "link3",
                                               "link4", "link5",  "link6", "link7",
                                               "hand",  "finger", "finger"};
  return kNames[link];
}

RobotDescription read_panda(const std::filesystem::path& data, GeometrySource source) {
  const std::string package = franka_package(data);
  std::ifstream file(package + "/robots/panda.urdf");
  std::stringstream text;
  text << file.rdbuf();
  return parse_urdf(text.str(), source, [&](const std::string&) { return package; });
}

RobotDescription panda_description(const std::filesystem::path& data) {
  RobotDescription description;
  description.name = "panda";
  for (std::size_t i = 0; i < kPandaLinks; ++i) {
    const auto file =
        data / "robots/franka_description/meshes/visual" / (std::string(panda_mesh(i)) + ".dae");
    LinkDescription link;
    link.name = panda_mesh(i) + std::to_string(i);
    link.geometry = {
        GeometryElement{load_mesh(file.string()), Eigen::Isometry3d::Identity(), file.string()}};
    description.links.push_back(std::move(link));
  }
  return description;
}

std::shared_ptr<RobotModel> panda_model(const std::filesystem::path& data, double max_error) {
  RobotModelConfig config;
  config.packing.max_error = packed_to(max_error);
  return std::make_shared<RobotModel>(*build_robot_model(panda_description(data), config));
}

CloudSnapshot truth_cloud(const std::filesystem::path& data, const std::string& name) {
  Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
  std::ifstream file(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) file >> X(i / 4, i % 4);
  const std::vector<Eigen::Vector3f> points =
      read_pcd((data / "clouds" / (name + ".pcd")).string());
  std::vector<float> x, y, z;
  std::vector<std::uint32_t> id;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    const Eigen::Vector3d p =
        X.topLeftCorner<3, 3>() * points[i].cast<double>() + X.topRightCorner<3, 1>();
    x.push_back(static_cast<float>(p.x()));
    y.push_back(static_cast<float>(p.y()));
    z.push_back(static_cast<float>(p.z()));
    id.push_back(static_cast<std::uint32_t>(i));
  }
  CloudSnapshot snapshot;
  snapshot.index.build(Eigen::Vector3d::Zero(), x.data(), y.data(), z.data(), id.data(), x.size());
  return snapshot;
}

std::vector<TruthCase> truth_cases(const std::filesystem::path& data, const std::string& cloud,
                                   const std::string& motion) {
  const Npy poses = read_npy((data / "poses" / (motion + ".npy")).string());
  std::ifstream file(data / "truth" / ("truth_" + cloud + "_" + motion + ".bin"), std::ios::binary);
  const std::size_t stride = motion == "traj" ? 20 : 1;
  std::vector<TruthCase> cases(kTruthPoses);
  for (std::size_t k = 0; k < kTruthPoses; ++k) {
    for (std::size_t link = 0; link < kPandaLinks; ++link) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      for (int i = 0; i < 12; ++i) {
        X.matrix()(i / 4, i % 4) =
            poses.values.at((k * stride * kPandaLinks + link) * 12 + static_cast<std::size_t>(i));
      }
      cases[k].X_FL.push_back(X);
      char record[40];
      if (!file.read(record, sizeof record)) throw std::runtime_error("truth is truncated");
      std::memcpy(&cases[k].links[link].distance, record, 8);
      std::memcpy(&cases[k].links[link].points_inside, record + 36, 4);
    }
  }
  return cases;
}

}  // namespace ist::test
