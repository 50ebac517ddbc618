#pragma once

#include <cstddef>
#include <ostream>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "pack_robot/input.h"

namespace ist::tools {

/// The table's row of one link, in SI units.
struct Row {
  std::string link;
  std::size_t triangles = 0, boundary_edges = 0, spheres = 0;
  std::size_t nodes = 0, leaves = 0;  ///< of the tree
  double solid_volume = 0.0, filled_volume = 0.0;
  double max_gap = 0.0, mean_gap = 0.0, protrusion = 0.0;
  double seconds = 0.0;
  bool reached = false, from_cache = false;
};

/// One row for each link that was packed.
std::vector<Row> measure(const Input& input, const RobotModel& model);

/// Prints the table to standard output, in mm, cm^3 and s.
void print_table(const std::vector<Row>& rows);

/// Appends the rows in SI units; the header comes first if `csv` is empty.
void append_csv(double max_error, const std::vector<Row>& rows, std::ostream* csv);

/// All spheres as the vertices of an ASCII PLY file, links at joint positions 0.
std::string ply(const Input& input, const RobotModel& model);

/// @throws ModelError when the file cannot be written
void write_file(const std::string& path, const std::string& text);

}  // namespace ist::tools
