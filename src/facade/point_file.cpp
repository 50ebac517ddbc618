#include "point_file.h"

#include <algorithm>
#include <cctype>
#include <memory>
#include <utility>
#include <vector>

#include "internal/facade/sensor_points.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/regular_file.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

bool ends_in(const std::string& path, const std::string& extension) {
  if (path.size() < extension.size()) return false;
  std::string end = path.substr(path.size() - extension.size());
  for (char& c : end) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return end == extension;
}

}  // namespace

PointFile read_sensor_points(const std::string& path) {
  const bool is_pcd = ends_in(path, ".pcd");
  std::string problem;
  PointFile file;
  if (!is_pcd && !ends_in(path, ".ply")) {
    problem = "has an extension that is not read; .pcd and .ply are";
  } else {
    std::string bytes;
    problem = read_regular_file(path, kMaxPointFileSize, &bytes);
    if (problem.empty()) problem = is_pcd ? parse_pcd(bytes, &file) : parse_ply(bytes, &file);
  }
  if (!problem.empty()) throw ModelError("point file '" + printable(path) + "' " + problem);
  return file;
}

RawCloud to_cloud(PointFile file) {
  const auto is_exact = [](const Eigen::Vector3d& p) {
    return (p.array() == p.cast<float>().cast<double>().array() || p.array().isNaN()).all();
  };
  RawCloud cloud;
  if (std::all_of(file.points.begin(), file.points.end(), is_exact)) {
    auto points = std::make_shared<std::vector<Eigen::Vector3f>>();
    points->reserve(file.points.size());
    for (const Eigen::Vector3d& p : file.points) points->push_back(p.cast<float>());
    cloud = packed_cloud(reinterpret_cast<const float*>(points->data()), file.width, file.height);
    cloud.owner = std::move(points);
  } else {
    auto points = std::make_shared<std::vector<Eigen::Vector3d>>(std::move(file.points));
    cloud = packed_cloud(reinterpret_cast<const double*>(points->data()), file.width, file.height);
    cloud.owner = std::move(points);
  }
  return cloud;
}

PointFile read_points(const std::string& path) {
  PointFile file = read_sensor_points(path);
  if (file.X_QS.matrix().isIdentity(0.0)) return file;
  for (Eigen::Vector3d& p : file.points) p = file.X_QS * p;
  return file;
}

}  // namespace ist
