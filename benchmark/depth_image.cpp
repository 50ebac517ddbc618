// Cost of the ingest of a depth image beside that of the cloud which is made of it, as a Markdown
// table. The image is 640 x 480: boxes in front of a wall, with pixels that saw nothing.
//
// One thread, processor time of that thread, with warm caches. Usage: depth_image [repetitions]

#include "ist_proximity/cloud/depth_image.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support.h"
#include "support/whole_cloud.h"

namespace {

using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

constexpr std::uint32_t kWidth = 640, kHeight = 480;
constexpr double kFocalLength = 525.0, kCx = 319.5, kCy = 239.5;

// By pixel [mm]; 0: nothing is known.
std::vector<std::uint16_t> picture() {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 2.0);
  std::vector<std::uint16_t> depths;
  for (std::uint32_t v = 0; v < kHeight; ++v) {
    for (std::uint32_t u = 0; u < kWidth; ++u) {
      double depth = 1500.0 + 0.4 * u;
      if (v > 300) depth = 1500.0 * 300.0 / v;
      if ((u / 120 + v / 110) % 3 == 0 && u % 120 > 40 && v % 110 > 30) depth = 900.0 + 0.2 * v;
      depths.push_back(
          static_cast<std::uint16_t>(random() % 40 == 0 ? 0L : std::lround(depth + noise(random))));
    }
  }
  return depths;
}

struct Images {
  std::vector<std::uint16_t> millimetres = picture();
  std::vector<float> metres;
  std::vector<float> cloud;  // four floats a point
  std::shared_ptr<const ist::DepthRays> rays;

  Images() {
    for (const std::uint16_t depth : millimetres) metres.push_back(0.001F * depth);
    ist::CameraModel camera;
    camera.width = kWidth;
    camera.height = kHeight;
    camera.K = {kFocalLength, 0, kCx, 0, kFocalLength, kCy, 0, 0, 1};
    const std::string fault = ist::check_camera(camera, &rays);
    if (!fault.empty()) std::fprintf(stderr, "%s\n", fault.c_str());
    make_cloud();
  }

  // What a driver or depth_image_proc does.
  void make_cloud() {
    cloud.resize(4 * millimetres.size());
    for (std::size_t i = 0; i < millimetres.size(); ++i) {
      const float z = millimetres[i] == 0 ? std::numeric_limits<float>::quiet_NaN()
                                          : 0.001F * static_cast<float>(millimetres[i]);
      cloud[4 * i] = static_cast<float>(rays->x[i % kWidth]) * z;
      cloud[4 * i + 1] = static_cast<float>(rays->y[i / kWidth]) * z;
      cloud[4 * i + 2] = z;
    }
  }

  ist::RawCloud image(bool is_float) const {
    ist::DepthImage image;
    image.encoding = is_float ? "32FC1" : "16UC1";
    image.width = kWidth;
    image.height = kHeight;
    image.step = kWidth * (is_float ? 4 : 2);
    image.data = is_float ? reinterpret_cast<const std::uint8_t*>(metres.data())
                          : reinterpret_cast<const std::uint8_t*>(millimetres.data());
    image.data_size = std::size_t{kHeight} * image.step;
    ist::RawCloud raw;
    const std::string fault = ist::check_depth_image(image, rays, &raw);
    if (!fault.empty()) std::fprintf(stderr, "%s\n", fault.c_str());
    return raw;
  }

  ist::RawCloud points() const {
    ist::RawCloud raw;
    raw.data = reinterpret_cast<const std::uint8_t*>(cloud.data());
    raw.width = kWidth;
    raw.height = kHeight;
    raw.point_step = 4 * sizeof(float);
    raw.row_step = kWidth * raw.point_step;
    raw.y = sizeof(float);
    raw.z = 2 * sizeof(float);
    return raw;
  }
};

// Lazily loaded where the cloud is not thinned, as in the node.
double ingest_us(ist::RawCloud raw, bool thin, int repetitions) {
  raw.owner = std::make_shared<int>(0);  // the bytes stay where they are
  ist::Ingest ingest(ist::test::whole_cloud(thin));
  ist::CloudSnapshot snapshot;
  std::vector<double> us;
  ThreadTimer timer;
  for (int i = -2; i < repetitions; ++i) {
    timer.lap();
    ingest.run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
    const double lap = timer.lap();
    if (i >= 0) us.push_back(lap);
  }
  return quantile(us, 0.5);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 50;
  Images images;
  std::vector<double> making;
  ThreadTimer timer;
  for (int i = 0; i < repetitions; ++i) {
    timer.lap();
    images.make_cloud();
    making.push_back(timer.lap());
  }
  std::printf("making the cloud of 16UC1: %.0f us\n\n", quantile(making, 0.5));
  std::printf("| ingest of | points read by queries | / cloud | thinned | / cloud |\n");
  std::printf("|---|---|---|---|---|\n");
  const double lazy = ingest_us(images.points(), false, repetitions);
  const double thinned = ingest_us(images.points(), true, repetitions);
  const auto row = [&](const char* name, const ist::RawCloud& raw) {
    const double a = ingest_us(raw, false, repetitions), b = ingest_us(raw, true, repetitions);
    std::printf("| %s | %.0f us | %.2f | %.0f us | %.2f |\n", name, a, a / lazy, b, b / thinned);
  };
  row("PointCloud2, four floats a point", images.points());
  row("Image, 16UC1", images.image(false));
  row("Image, 32FC1", images.image(true));
  return 0;
}
