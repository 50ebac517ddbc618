// The noise filter beside PCL's radius outlier removal, where PCL is installed, as a Markdown
// table: a depth image of 640 x 480 pixels, as it is and with its points in random order. Both must
// drop the same points, but for those that float puts on the other side of the radius.
//
// One thread, processor time of that thread, with warm caches. Usage: noise_filter [repetitions]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "internal/cloud/noise_filter.h"
#include "peers/scene.h"
#include "support.h"
#include "support/data_dir.h"

#ifdef IST_PROXIMITY_HAS_PCL_FILTERS
#include <pcl/filters/radius_outlier_removal.h>
#include <pcl/point_types.h>
#endif

namespace {

using ist::benchmark::Frame;
using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

constexpr double kRadius = 0.02, kRange = 3.0;
constexpr int kNeighbors = 4;

struct Result {
  double us = 0.0;
  std::size_t dropped = 0;
};

Result ours(const Frame& frame, int repetitions) {
  ist::NoiseFilter filter({kRadius, kNeighbors});
  std::vector<double> us;
  std::uint32_t dropped = 0;
  ThreadTimer timer;
  for (int i = -1; i < repetitions; ++i) {
    timer.lap();
    filter.run(frame.raw(), kRange, &dropped);
    const double lap = timer.lap();
    if (i >= 0) us.push_back(lap);
  }
  return {quantile(us, 0.5), dropped};
}

#ifdef IST_PROXIMITY_HAS_PCL_FILTERS
Result pcls(const Frame& frame, int repetitions) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  pcl::RadiusOutlierRemoval<pcl::PointXYZ> filter(true);
  filter.setRadiusSearch(kRadius);
  filter.setMinNeighborsInRadius(kNeighbors);
  std::vector<double> us;
  std::size_t dropped = 0;
  ThreadTimer timer;
  for (int i = -1; i < repetitions; ++i) {
    timer.lap();
    cloud->clear();
    for (std::size_t k = 0; k < frame.width * frame.height; ++k) {
      const float* p = &frame.data[4 * k];
      const double range = std::hypot(p[0], p[1], p[2]);
      if (range <= kRange) cloud->emplace_back(p[0], p[1], p[2]);
    }
    filter.setInputCloud(cloud);
    std::vector<int> kept;
    filter.filter(kept);
    dropped = filter.getRemovedIndices()->size();
    const double lap = timer.lap();
    if (i >= 0) us.push_back(lap);
  }
  return {quantile(us, 0.5), dropped};
}
#else
Result pcls(const Frame& /*frame*/, int /*repetitions*/) {
  return {std::numeric_limits<double>::quiet_NaN(), 0};
}
#endif

void print(const std::string& name, const Frame& frame, int repetitions) {
  const Result a = ours(frame, repetitions), b = pcls(frame, repetitions);
  std::printf("| %s | %.1f ms | %zu | %.1f ms | %zu | %.1f |\n", name.c_str(), 1e-3 * a.us,
              a.dropped, 1e-3 * b.us, b.dropped, b.us / a.us);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 10;
  std::printf(
      "| frame | ours | dropped | PCL | dropped | PCL / ours |\n|---|---|---|---|---|---|\n");
  const auto both = [&](const std::string& name, const Frame& frame) {
    print(name, frame, repetitions);
    print(name + ", shuffled", shuffled(frame), repetitions);
  };
  both("synthetic", ist::benchmark::synthetic_frame(640, 480));
  if (const auto data = ist::test::data_dir()) {
    for (const auto& scene : ist::benchmark::kinect_data(*data, "").scenes) {
      both(scene.name, scene.frame);
    }
  }
  return 0;
}
