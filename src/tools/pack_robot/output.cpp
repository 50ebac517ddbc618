#include "output.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <variant>

#include "internal/geometry/boundary_edges.h"
#include "internal/packing/packing_report.h"
#include "ist_proximity/geometry/error.h"

namespace ist::tools {

std::vector<Row> measure(const Input& input, const RobotModel& model) {
  std::vector<Row> rows;
  for (const LinkModel& link : model.links) {
    if (!link.usable()) continue;
    Row row;
    row.link = link.name;
    row.triangles = link.solid.triangle_count();
    for (const LinkDescription& description : input.robot.links) {
      if (description.name != link.name) continue;
      for (const GeometryElement& element : description.geometry) {
        const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
        if (mesh != nullptr) row.boundary_edges += count_boundary_edges(*mesh);
      }
    }
    const PackingReport report = measure_packing(link.solid, link.packing.spheres);
    row.spheres = link.packing.spheres.size();
    row.nodes = link.tree.nodes().size();
    row.leaves = link.tree.leaves().size();
    row.solid_volume = report.solid_volume;
    row.filled_volume = report.filled_volume;
    row.protrusion = report.protrusion;
    row.max_gap = link.packing.certificate.max_gap;
    row.mean_gap = link.packing.certificate.mean_gap;
    row.reached = link.packing.certificate.reached;
    row.seconds = link.packing_time;
    row.from_cache = link.from_cache;
    rows.push_back(row);
  }
  return rows;
}

void print_table(const std::vector<Row>& rows) {
  std::printf("%-24s %9s %8s %8s %12s %10s %7s %8s %8s %10s %9s\n", "link", "triangles", "boundary",
              "spheres", "tree", "filled", "", "max gap", "mean gap", "protrusion", "seconds");
  std::printf("%-24s %9s %8s %8s %12s %10s %7s %8s %8s %10s\n", "", "", "edges", "", "nodes/leaves",
              "cm^3", "%", "mm", "mm", "mm");
  for (const Row& row : rows) {
    const double share = row.solid_volume > 0.0 ? row.filled_volume / row.solid_volume : 0.0;
    std::printf("%-24s %9zu %8zu %8zu %12s %10.4g %7.1f %8.3f %8.3f %10.4f %9.3f%s%s\n",
                row.link.c_str(), row.triangles, row.boundary_edges, row.spheres,
                (std::to_string(row.nodes) + "/" + std::to_string(row.leaves)).c_str(),
                1e6 * row.filled_volume, 100.0 * share, 1e3 * row.max_gap, 1e3 * row.mean_gap,
                1e3 * row.protrusion, row.seconds, row.from_cache ? " (cache)" : "",
                row.reached ? "" : " (max_error not reached)");
  }
}

void append_csv(double max_error, const std::vector<Row>& rows, std::ostream* csv) {
  if (csv->tellp() == std::streampos(0)) {
    *csv << "max_error,link,triangles,boundary_edges,spheres,solid_volume,filled_volume,max_gap,"
            "mean_gap,protrusion,seconds,reached,from_cache,nodes,leaves\n";
  }
  for (const Row& row : rows) {
    *csv << max_error << ',' << row.link << ',' << row.triangles << ',' << row.boundary_edges << ','
         << row.spheres << ',' << row.solid_volume << ',' << row.filled_volume << ',' << row.max_gap
         << ',' << row.mean_gap << ',' << row.protrusion << ',' << row.seconds << ',' << row.reached
         << ',' << row.from_cache << ',' << row.nodes << ',' << row.leaves << '\n';
  }
}

std::string ply(const Input& input, const RobotModel& model) {
  std::ostringstream vertices;
  std::size_t count = 0;
  std::string links;
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    const LinkModel& link = model.links[l];
    links += "comment link " + std::to_string(l) + " " + link.name + "\n";
    const auto pose = input.X_RL.find(link.name);
    for (const InnerSphere& sphere : link.packing.spheres) {
      const Eigen::Vector3d c =
          pose == input.X_RL.end() ? sphere.center : Eigen::Vector3d(pose->second * sphere.center);
      vertices << c.x() << ' ' << c.y() << ' ' << c.z() << ' ' << std::max(sphere.radius, 0.0)
               << ' ' << sphere.cover_radius << ' ' << l << '\n';
      ++count;
    }
  }
  return "ply\nformat ascii 1.0\ncomment spheres in metres\n" + links + "element vertex " +
         std::to_string(count) +
         "\nproperty double x\nproperty double y\nproperty double z\nproperty double radius\n"
         "property double cover_radius\nproperty int link\nend_header\n" +
         vertices.str();
}

void write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw ModelError("cannot write '" + path + "'");
}

}  // namespace ist::tools
