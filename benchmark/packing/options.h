#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "packing/table.h"

namespace ist::benchmark {

/// The tables to measure and their data.
struct Options {
  std::vector<std::string> tables;  ///< empty: all
  std::vector<std::string> links;   ///< of the Panda; empty: all
  std::vector<int> spheres;         ///< of the gaps; empty: all
  std::vector<double> max_errors;   ///< [m] of time and hierarchy; empty: all
  std::vector<std::string> scenes;  ///< of the hierarchy, by their first words; empty: all
  bool instructions = false;        ///< of the hierarchy's queries, by valgrind: takes minutes each
  int threads = 0;                  ///< for work that is not timed
  std::string cache_directory;      ///< packings that the hierarchy's queries need
  std::filesystem::path data;       ///< the folder of test data; empty: not there
  std::string program;              ///< this program's path, to run parts of it under valgrind
  bool update_doc = false;
};

struct PandaLink {
  std::string name;
  TriangleMesh mesh;
};

/// The Panda's visual meshes that the options select; the two fingers are one mesh.
std::vector<PandaLink> panda_links(const Options& options);

/// The names of all of them.
std::vector<std::string> panda_names();

/// The tables, one function each. They return false if the table could not be made.
bool measure_time(const Options& options, Table* table);
bool measure_anytime(const Options& options, Table* table);
bool measure_gaps(const Options& options, Table* table);
bool measure_certificate(const Options& options, Table* table);
bool measure_growth(const Options& options, Table* table);
bool measure_hierarchy(const Options& options, Table* table);

/// Runs some queries between callgrind's marks: `packing --count`, under valgrind.
void count_instructions(const Options& options, const std::string& scene);

/// Draws the document's table of growth into an SVG file.
void plot_growth(const std::string& document, const std::string& path);

Table time_table();
Table anytime_table();
Table gaps_table();
Table certificate_table();
Table growth_table();
Table hierarchy_table();

}  // namespace ist::benchmark
