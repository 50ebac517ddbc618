// Cost of the ingest of a depth image, organized and shuffled, against copying its bytes, as a
// Markdown table. The frames are 640 x 480: a synthetic one, and those of the test data.
//
// One thread, processor time of that thread, with warm caches. Usage: ingest [repetitions]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "ist_proximity/cloud/ingest.h"
#include "peers/scene.h"
#include "support.h"
#include "support/data_dir.h"
#include "support/whole_cloud.h"

namespace {

using ist::benchmark::Frame;
using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

// Asks for every point of the thinned cloud.
void thin_all(const ist::CloudSnapshot& snapshot) {
  const ist::ThinnedCloud cloud = snapshot.index.bvh().thinned();
  ist::ThinnedNode buffer;
  for (std::size_t i = 0; i < cloud.nodes().size(); ++i) {
    if (!ist::ThinnedCloud::is_leaf(cloud.nodes()[i])) continue;
    cloud.tiles(static_cast<std::int32_t>(i), &buffer);
  }
}

double ingest_us(const Frame& frame, bool thin, int repetitions) {
  ist::Ingest ingest(ist::test::whole_cloud(thin));
  ist::CloudSnapshot snapshot;
  ingest.run(frame.raw(), frame.X_FS, {}, 0.0, &snapshot);
  std::vector<double> us;
  ThreadTimer timer;
  for (int i = 0; i < repetitions; ++i) {
    timer.lap();
    ingest.run(frame.raw(), frame.X_FS, {}, 0.0, &snapshot);
    if (thin) thin_all(snapshot);
    us.push_back(timer.lap());
  }
  return quantile(us, 0.5);
}

void print(const std::string& name, const Frame& frame, int repetitions) {
  const double copy = ist::benchmark::copy_us(frame.data.data(), frame.bytes(), repetitions);
  const double image = ingest_us(frame, false, repetitions);
  const double thinned = ingest_us(frame, true, repetitions);
  const double mixed = ingest_us(shuffled(frame), false, repetitions);
  std::printf("| %s | %.0f us | %.0f us | %.1f | %.0f us | %.1f | %.0f us |\n", name.c_str(), copy,
              image, image / copy, mixed, mixed / copy, thinned);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 50;
  std::printf(
      "| frame | memcpy | organized | / memcpy | shuffled | / memcpy | organized, and all thinned "
      "|\n"
      "|---|---|---|---|---|---|---|\n");
  print("synthetic", ist::benchmark::synthetic_frame(640, 480), repetitions);
  if (const auto data = ist::test::data_dir()) {
    for (const auto& scene : ist::benchmark::kinect_data(*data, "").scenes) {
      print(scene.name, scene.frame, repetitions);
    }
  }
  return 0;
}
