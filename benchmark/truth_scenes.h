#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <vector>

#include "support/data_dir.h"
#include "support/truth.h"

namespace ist::benchmark {

/// The test data's folder. Ends the program with a message if there is none.
inline std::filesystem::path data_or_exit() {
  if (const auto data = test::data_dir()) return *data;
  std::fprintf(stderr, "%s\n", test::kNoData.c_str());
  std::exit(1);
}

/// One depth image of the test data and one motion of the arm in it, with exact distances.
struct TruthScene {
  std::shared_ptr<CloudSnapshot> cloud;
  std::vector<test::TruthCase> cases;
};

/// The scenes of three images with two motions each.
inline std::vector<TruthScene> truth_scenes(const std::filesystem::path& data) {
  std::vector<TruthScene> scenes;
  for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
    const auto cloud = std::make_shared<CloudSnapshot>(test::truth_cloud(data, name));
    for (const char* motion : {"traj", "rand"}) {
      scenes.push_back({cloud, test::truth_cases(data, name, motion)});
    }
  }
  return scenes;
}

}  // namespace ist::benchmark
