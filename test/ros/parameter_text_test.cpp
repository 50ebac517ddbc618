// The table of parameters as a commented YAML file with the defaults: config/proximity.yaml.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "ros/common/text.h"
#include "ros/parameters/parameter_table.h"

namespace ist {
namespace {

constexpr char kTop[] =
    "# All parameters of the node with their defaults; parameter_text_test writes this file. Copy "
    "what\n"
    "# you change, and pass the copy's path to launch/proximity.launch (params:=...). What is live "
    "can be\n"
    "# changed while the node runs, by dynamic_reconfigure or rosparam set.\n\n";
constexpr char kSingle[] =
    "\n# The single source, the sensor_msgs/PointCloud2 on the topic `cloud`. With `sources`, "
    "these are\n"
    "# the defaults of its entries.\n\n";
constexpr char kZones[] =
    "\n# Zones whose points are no obstacles, for the links that are named, or for all.\n"
    "# zones:\n#   bin: {frame_id: bin, shape: box, size: [0.4, 0.6, 0.3], links: [finger_link], "
    "lifetime: 60}\n";
constexpr char kSources[] =
    "\n# One entry for each sensor, map or known world, in place of the single source. What stands "
    "above\n"
    "# may be in it, too, as far as it is for sources of its type. Each name is explained once.\n"
    "# sources:\n";

/// A default as YAML writes it; empty where there is none.
struct YamlValue {
  std::string operator()(const double* value) const {
    return std::isinf(*value) ? ".inf" : number_text(*value);
  }
  std::string operator()(const int* value) const { return std::to_string(*value); }
  std::string operator()(const std::size_t* value) const { return std::to_string(*value); }
  std::string operator()(const bool* value) const { return *value ? "true" : "false"; }
  std::string operator()(const std::string* value) const { return *value; }
  std::string operator()(const Path& place) const { return *place.path; }
  std::string operator()(const Choice& choice) const { return choice.words.at(choice.current); }
  std::string operator()(const WordOr& either) const { return (*this)(either.word); }
  std::string operator()(const Eigen::Vector3d* numbers) const {
    std::vector<std::string> texts;
    for (int i = 0; i < 3; ++i) texts.push_back(number_text((*numbers)[i]));
    return "[" + join(texts, ", ") + "]";
  }
  template <class List>  // all lists of names are empty
  std::string operator()(const List* /*value*/) const {
    return "";
  }
};

/// The help, and the words, unit and range, and whether it is live.
std::string comment_of(const Parameter& row) {
  std::vector<std::string> facts;
  const auto* either = std::get_if<WordOr>(&row.value);
  const Choice* words = either ? &either->word : std::get_if<Choice>(&row.value);
  if (words) facts.push_back(join(words->words, ", "));
  const bool has_range = *row.range.unit || std::isfinite(row.range.max);
  if (has_range && !row.is_bool()) facts.push_back(row.range.text());
  if (row.is_live()) facts.emplace_back("live");
  const std::string gap = *row.help && !facts.empty() ? " " : "";
  return row.help + (facts.empty() ? "" : gap + "(" + join(facts, "; ") + ")");
}

/// The rows as YAML, with a dictionary around those whose names have slashes.
/// @param margin  before each line
/// @param at      what is left out of the names
/// @param seen    names that are left out, but for the first row, which says what the others are;
///                those that are written are added
std::string yaml_of(const std::vector<Parameter>& rows, const std::string& margin,
                    const std::string& at, std::set<std::string>* seen) {
  std::string text, folder;
  for (const Parameter& row : rows) {
    const std::string name = row.name.substr(at.size());
    const bool is_new = seen->insert(name).second;
    if (!is_new && !text.empty()) continue;
    const std::string value = std::visit(YamlValue(), row.value);
    const std::string start = value.empty() ? "# " : "";
    std::string indent = margin;
    std::size_t begin = 0;
    for (std::size_t end; (end = name.find('/', begin)) != std::string::npos; begin = end + 1) {
      const bool is_open = folder.compare(0, end + 1, name, 0, end + 1) == 0;
      if (!is_open) text += indent + start + name.substr(begin, end - begin) + ":\n";
      indent += "  ";
    }
    folder = name.substr(0, begin);
    const std::string comment = comment_of(row);
    if (is_new && !comment.empty()) text += indent + "# " + comment + "\n";
    text += indent + start + name.substr(begin) + ":" + (value.empty() ? "" : " " + value) + "\n";
  }
  return text;
}

std::string parameter_text() {
  std::set<std::string> seen;
  ServerConfig config;
  SourceConfig single;
  std::string text = kTop + yaml_of(node_parameters(&config), "", "", &seen);
  text += kZones;
  text += kSingle + yaml_of(source_parameters("", &single), "", "", &seen) + kSources;
  for (int i = 0; i <= static_cast<int>(SourceType::kWorld); ++i) {
    SourceConfig source;
    source.type = static_cast<SourceType>(i);
    std::set<std::string> seen_of_type = seen;
    text += std::string("#   ") + noun(source.type) + ":\n";
    text += yaml_of(source_parameters("/", &source), "#     ", "/", &seen_of_type);
    if (i == 0) seen = seen_of_type;
  }
  WrittenObject box;
  box.shape = 0;
  WorldObjectConfig object;
  std::set<std::string> seen_of_object;
  text += "#     objects:\n#       table:\n";
  return text + yaml_of(object_parameters("/", &box, &object), "#         ", "/", &seen_of_object);
}

// A parameter is a member with its default and a row of the table; the file is not written by hand.
TEST(ParameterText, IsTheConfiguration) {
  const std::string path = std::string(IST_PROXIMITY_SOURCE_DIR) + "/config/proximity.yaml";
  if (std::getenv("IST_PROXIMITY_UPDATE_DOC") != nullptr) std::ofstream(path) << parameter_text();
  std::ifstream file(path);
  const std::string found{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  EXPECT_EQ(found, parameter_text());
}

// A live row elsewhere would show its changes and never have an effect.
TEST(Parameters, LiveOnesAreInWhatTheCyclesTake) {
  ServerConfig config;
  const LiveConfig* const live = &config;
  const std::set<std::string> groups = {"query", "repulsion", "speed_scale",
                                        "speed_scale/separation"};
  for (const Parameter& row : live_parameters(&config)) {
    const void* const value = row.is_bool() ? std::get<bool*>(row.value)
                                            : static_cast<void*>(std::get<double*>(row.value));
    EXPECT_GE(value, static_cast<const void*>(live)) << row.name;
    EXPECT_LT(value, static_cast<const void*>(live + 1)) << row.name;
    EXPECT_EQ(groups.count(row.name.substr(0, row.name.rfind('/'))), 1u)
        << "LiveParameters has no group of ~" << row.name;
  }
}

}  // namespace
}  // namespace ist
