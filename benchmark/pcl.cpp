// What this package does itself beside what PCL does, in the same run: the noise filter beside
// RadiusOutlierRemoval at the same radius and number of neighbors on recorded clouds, with the
// points that only one of them drops; the reading of their files; and what both readers say of
// files that are cut off.
#include <pcl/console/print.h>
#include <pcl/filters/radius_outlier_removal.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/pcl.h"
#include "support.h"
#include "support/temp_dir.h"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using ist::benchmark::quantile;
using ist::benchmark::text_of;
using ist::benchmark::ThreadTimer;

constexpr int kNeighbors = 4;  // the node's default
constexpr int kRepetitions = 3;

struct Noise {
  double radius = 0.0;              // [m]
  std::vector<double> ours, peers;  // [us]
  std::size_t points = 0, dropped = 0, different = 0;
};

void filter(const Cloud::Ptr& cloud, Noise* noise) {
  ist::NoiseFilter ours({noise->radius, kNeighbors});
  pcl::RadiusOutlierRemoval<pcl::PointXYZ> peer(true);
  peer.setRadiusSearch(noise->radius);
  peer.setMinNeighborsInRadius(kNeighbors);
  peer.setInputCloud(cloud);
  // It aborts at a point of NaN, so that it gets the others only.
  const auto finite = std::make_shared<pcl::Indices>();
  for (std::size_t i = 0; i < cloud->size(); ++i) {
    if (std::isfinite((*cloud)[i].x)) finite->push_back(static_cast<int>(i));
  }
  peer.setIndices(finite);
  ist::RawCloud kept;
  pcl::Indices kept_by_peer;
  for (int i = 0; i < kRepetitions; ++i) {
    ThreadTimer timer;
    std::uint32_t dropped = 0;
    kept = ours.run(ist::view(*cloud).points, std::numeric_limits<double>::infinity(), &dropped);
    noise->ours.push_back(timer.lap());
    peer.filter(kept_by_peer);
    noise->peers.push_back(timer.lap());
    if (i == 0) noise->dropped += dropped;
  }
  const auto* points = reinterpret_cast<const Eigen::Vector3d*>(kept.data);
  std::vector<bool> is_kept(cloud->size(), false);
  for (const int i : kept_by_peer) is_kept[static_cast<std::size_t>(i)] = true;
  noise->points += finite->size();
  for (const int i : *finite) {
    const auto at = static_cast<std::size_t>(i);
    noise->different += std::isfinite(points[at].x()) != is_kept[at] ? 1 : 0;
  }
}

/// Reads a file with PCL. @returns whether PCL takes it for a whole one
bool read_with_pcl(const std::string& path) {
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin;
  Eigen::Quaternionf orientation;
  int version = 0;
  if (path.substr(path.size() - 3) == "ply") {
    return pcl::PLYReader().read(path, cloud, origin, orientation, version) >= 0;
  }
  return pcl::PCDReader().read(path, cloud, origin, orientation, version) >= 0;
}

bool read_with_ours(const std::string& path) {
  try {
    ist::read_points(path);
  } catch (const ist::ModelError&) {
    return false;
  }
  return true;
}

struct Verdicts {
  std::size_t files = 0, taken = 0, crashed = 0;
};

/// Reads in a process of its own, which may crash.
void judge(const std::function<bool()>& read, Verdicts* verdicts) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(5);
    bool is_taken = false;
    try {
      is_taken = read();
    } catch (const std::exception&) {
    }
    _exit(is_taken ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ++verdicts->files;
  if (WIFSIGNALED(status)) {
    ++verdicts->crashed;
  } else {
    verdicts->taken += WEXITSTATUS(status) == 1 ? 1 : 0;
  }
}

/// Cuts files that PCL has written at every byte before the last point's last number.
void cut_off(Verdicts* ours, Verdicts* peers) {
  const ist::test::TempDir folder;
  Cloud cloud(4, 2);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud[i].x = 0.25F * static_cast<float>(i);
  pcl::PCDWriter pcd;
  pcd.writeASCII(folder.file("ascii.pcd"), cloud);
  pcd.writeBinary(folder.file("binary.pcd"), cloud);
  pcd.writeBinaryCompressed(folder.file("compressed.pcd"), cloud);
  pcl::PLYWriter().write(folder.file("ascii.ply"), cloud, false, false);
  pcl::PLYWriter().write(folder.file("binary.ply"), cloud, true, false);
  for (const char* name :
       {"ascii.pcd", "binary.pcd", "compressed.pcd", "ascii.ply", "binary.ply"}) {
    std::ifstream file(folder.file(name), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    const std::string path = folder.file(std::string("cut_") + name);
    for (std::size_t size = 0; size + 3 < bytes.size(); ++size) {
      std::ofstream(path, std::ios::binary) << bytes.substr(0, size);
      judge([&] { return read_with_pcl(path); }, peers);
      judge([&] { return read_with_ours(path); }, ours);
    }
  }
}

// Of a reader: the row of the table.
std::string reader_row(const char* name, const std::vector<double>& us, const Verdicts& verdicts) {
  return text_of("| %s | %.1f ms | %zu of %zu | %zu |\n", name, 1e-3 * quantile(us, 0.5),
                 verdicts.taken, verdicts.files, verdicts.crashed);
}

}  // namespace

int main(int argc, char** argv) {
  ist::benchmark::CommandLine line("The noise filter and the reading of files, beside PCL.");
  line.read(argc, argv);
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  std::array<Noise, 3> noises;
  noises[0].radius = 0.005;
  noises[1].radius = 0.01;
  noises[2].radius = 0.02;
  std::vector<double> ours, peers;  // [us]
  for (const auto& entry :
       std::filesystem::directory_iterator(ist::benchmark::data_or_exit() / "clouds")) {
    if (entry.path().extension() != ".pcd") continue;
    const auto cloud = std::make_shared<Cloud>();
    for (int i = 0; i < kRepetitions; ++i) {
      ThreadTimer timer;
      ist::read_points(entry.path().string());
      ours.push_back(timer.lap());
      pcl::io::loadPCDFile(entry.path().string(), *cloud);
      peers.push_back(timer.lap());
    }
    for (Noise& noise : noises) filter(cloud, &noise);
  }
  Verdicts our_verdicts, peer_verdicts;
  cut_off(&our_verdicts, &peer_verdicts);
  std::string text =
      "| noise filter, radius | this package | `RadiusOutlierRemoval` | | dropped | by one of the "
      "two |\n|---|---|---|---|---|---|\n";
  for (const Noise& one : noises) {
    const double our_ms = 1e-3 * quantile(one.ours, 0.5), ms = 1e-3 * quantile(one.peers, 0.5);
    text +=
        text_of("| %.0f mm | %.1f ms | %.1f ms | %.1f times | %zu of %zu | %zu |\n",
                1e3 * one.radius, our_ms, ms, ms / our_ms, one.dropped, one.points, one.different);
  }
  text +=
      "\n| | a PCD file | files cut off that are taken for whole | crashes |\n|---|---|---|---|\n" +
      reader_row("this package", ours, our_verdicts) + reader_row("PCL", peers, peer_verdicts);
  return line.publish("beside pcl", text);
}
