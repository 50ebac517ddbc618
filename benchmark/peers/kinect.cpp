#include <fstream>

#include "peers/scene.h"
#include "support/npy.h"
#include "support/pcd.h"
#include "support/truth.h"

namespace ist::benchmark {

std::vector<Poses> recorded_motion(const std::filesystem::path& data, std::size_t count) {
  const std::vector<double> values = test::read_npy((data / "poses/traj.npy").string()).values;
  std::vector<Poses> poses(count, Poses(test::kPandaLinks, Eigen::Isometry3d::Identity()));
  std::size_t next = 0;
  for (Poses& X_FL : poses) {
    for (Eigen::Isometry3d& X : X_FL) {
      for (int i = 0; i < 12; ++i) X.matrix()(i / 4, i % 4) = values.at(next++);
    }
  }
  return poses;
}

DataSet kinect_data(const std::filesystem::path& data, const std::string& cache_directory) {
  DataSet set{"kinect", {{}, cache_directory}, {}, {}};
  for (const LinkDescription& link : test::panda_description(data).links) {
    set.robot.meshes.push_back(std::get<TriangleMesh>(link.geometry.front().shape));
  }
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  std::ifstream file(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) file >> X_FS.matrix()(i / 4, i % 4);
  for (const std::string name : {"mosd0", "mosd10", "mosd40"}) {
    const auto points = test::read_pcd((data / "clouds" / (name + ".pcd")).string());
    Scene scene{name, make_frame(points, X_FS), {}};
    for (const char* motion : {"traj", "rand"}) {
      for (const test::TruthCase& truth : test::truth_cases(data, name, motion)) {
        Configuration configuration{truth.X_FL, {}, {}};
        for (const test::TruthRecord& link : truth.links) {
          configuration.distance.push_back(link.distance);
          configuration.is_contact.push_back(link.points_inside > 0);
        }
        scene.configurations.push_back(std::move(configuration));
      }
    }
    set.scenes.push_back(std::move(scene));
  }
  set.motion = interpolated(recorded_motion(data, 200), 10);
  return set;
}

}  // namespace ist::benchmark
