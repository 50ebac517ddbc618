// Cost of the contact wrench against the cost of the link's distance query in the same run, for
// links in contact with real clouds, as a Markdown table.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Usage: contact [poses per cloud]

#include "ist_proximity/contact/contact_volume.h"

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/geometry/mesh_io.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "truth_scenes.h"

namespace {

using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

std::vector<std::shared_ptr<const ist::ContactGeometry>> bodies(const std::filesystem::path& data,
                                                                const ist::RobotModel& model) {
  std::vector<std::shared_ptr<const ist::ContactGeometry>> result;
  double seconds = 0.0;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const auto file = data / "robots/franka_description/meshes/visual" /
                      (std::string(ist::test::panda_mesh(i)) + ".dae");
    const ist::LinkGeometry geometry = {ist::GeometryElement{
        ist::load_mesh(file.string()), Eigen::Isometry3d::Identity(), file.string()}};
    result.push_back(ist::build_contact_geometry(geometry, 0, model.links[i], {}, ""));
    seconds += result.back()->time;
  }
  std::printf("%zu links packed disjointly in %.1f s\n\n", result.size(), seconds);
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const std::size_t poses = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 100;
  const auto model = ist::test::panda_model(data, 0.005);
  const auto contacts = bodies(data, *model);
  std::vector<double> query_us, contact_us, ratios, points;
  for (const auto& scene : ist::benchmark::truth_scenes(data)) {
    ist::CloudSnapshot& cloud = *scene.cloud;
    cloud.index.bvh().set_thinning(cloud.thinning);
    ist::ProximityQuery query(model, {});
    std::vector<ist::LinkProximity> results;
    std::size_t pose = 0;
    for (const ist::test::TruthCase& truth : scene.cases) {
      if (pose++ == poses) break;
      for (std::size_t i = 0; i < truth.X_FL.size(); ++i) {
        if (truth.links[i].points_inside == 0) continue;
        std::vector<bool> known(truth.X_FL.size(), false);
        known[i] = true;
        ThreadTimer timer;
        query.run(truth.X_FL, known, {&cloud}, &results);
        query_us.push_back(timer.lap());
        const ist::ContactVolume found =
            ist::contact_volume(model->links[i], *contacts[i], truth.X_FL[i], {&cloud});
        contact_us.push_back(timer.lap());
        ratios.push_back(contact_us.back() / query_us.back());
        points.push_back(static_cast<double>(found.spheres));
      }
    }
  }
  std::printf("%zu cases of a link in contact\n\n| | median | 99th percentile | largest |\n",
              query_us.size());
  std::printf("|---|---|---|---|\n");
  const auto row = [](const char* what, const std::vector<double>& values, const char* format) {
    std::printf("| %s", what);
    for (const double q : {0.5, 0.99, 1.0}) {
      std::printf(" | ");
      std::printf(format, quantile(values, q));
    }
    std::printf(" |\n");
  };
  row("distance query [us]", query_us, "%.0f");
  row("contact volume [us]", contact_us, "%.0f");
  row("ratio", ratios, "%.2f");
  row("points that count", points, "%.0f");
  return 0;
}
