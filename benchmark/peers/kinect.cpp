#include <algorithm>
#include <fstream>

#include "internal/geometry/mesh_io.h"
#include "peers/scene.h"
#include "support/npy.h"
#include "support/pcd.h"
#include "support/truth.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kWidth = 640, kHeight = 480;
constexpr std::size_t kMotionPoses = 200;

Frame frame_of(const std::filesystem::path& data, const std::string& name) {
  Frame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  for (const Eigen::Vector3f& p : test::read_pcd((data / "clouds" / (name + ".pcd")).string())) {
    frame.data.insert(frame.data.end(), {p.x(), p.y(), p.z(), 0.0F});
  }
  std::ifstream file(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) file >> frame.X_FS.matrix()(i / 4, i % 4);
  return frame;
}

std::vector<std::vector<Eigen::Isometry3d>> trajectory(const std::filesystem::path& data) {
  const test::Npy array = test::read_npy((data / "poses/traj.npy").string());
  std::vector<std::vector<Eigen::Isometry3d>> poses(kMotionPoses);
  for (std::size_t k = 0; k < kMotionPoses; ++k) {
    for (std::size_t link = 0; link < test::kPandaLinks; ++link) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      for (int i = 0; i < 12; ++i) {
        X.matrix()(i / 4, i % 4) =
            array.values.at((k * test::kPandaLinks + link) * 12 + static_cast<std::size_t>(i));
      }
      poses[k].push_back(X);
    }
  }
  return poses;
}

}  // namespace

DataSet kinect_data(const std::filesystem::path& data, const std::string& cache_directory) {
  DataSet set;
  set.name = "kinect";
  set.robot.cache_directory = cache_directory;
  for (std::size_t i = 0; i < test::kPandaLinks; ++i) {
    set.robot.meshes.push_back(load_mesh((data / "robots/franka_description/meshes/visual" /
                                          (std::string(test::panda_mesh(i)) + ".dae"))
                                             .string()));
  }
  for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
    Scene scene{name, frame_of(data, name), {}};
    for (const char* motion : {"traj", "rand"}) {
      for (const test::TruthCase& truth : test::truth_cases(data, name, motion)) {
        Configuration configuration;
        configuration.X_FL = truth.X_FL;
        for (const test::TruthRecord& link : truth.links) {
          configuration.distance.push_back(link.distance);
          configuration.is_contact.push_back(link.points_inside > 0);
        }
        scene.configurations.push_back(std::move(configuration));
      }
    }
    set.scenes.push_back(std::move(scene));
  }
  set.motion = interpolated(trajectory(data), 10);
  return set;
}

}  // namespace ist::benchmark
