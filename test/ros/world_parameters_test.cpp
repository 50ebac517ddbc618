// The parameters of a source of type world: what is read, and how mistakes are named.

#include <gtest/gtest.h>
#include <xmlrpcpp/XmlRpc.h>

#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>
#include <variant>
#include <vector>

#include "ros/input/world_faults.h"
#include "ros/parameters/parameters.h"
#include "support/errors.h"

namespace ist {
namespace {

using XmlRpc::XmlRpcValue;

XmlRpcValue list(const std::vector<double>& numbers) {
  XmlRpcValue value;
  value.setSize(static_cast<int>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i) value[static_cast<int>(i)] = numbers[i];
  return value;
}

// A table, a mesh, and another robot.
XmlRpcValue good() {
  XmlRpcValue tree;
  XmlRpcValue& cell = tree["sources"]["cell"];
  cell["type"] = "world";
  cell["frame_id"] = "hall";
  cell["margin"] = 0.01;
  XmlRpcValue& table = cell["objects"]["table"];
  table["shape"] = "box";
  table["size"] = list({1.0, 2.0, 0.1});
  table["position"] = list({0.0, 0.0, -0.05});
  table["rpy"] = list({0.0, 0.0, 1.5707963267948966});
  XmlRpcValue& wall = cell["objects"]["wall"];
  wall["shape"] = "mesh";
  wall["mesh"] = "package://cell/wall.stl";
  wall["frame_id"] = "map";
  wall["margin"] = 0.5;
  cell["robot"]["description"] = "/other/robot_description";
  return tree;
}

TEST(WorldParameters, AreRead) {
  std::vector<std::string> warnings;
  const ServerConfig config = parse_parameters(good(), &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  ASSERT_EQ(config.sources.size(), 1U);
  const SourceConfig& source = config.sources[0];
  EXPECT_EQ(source.type, SourceType::kWorld);
  EXPECT_TRUE(std::isinf(source.timeout));
  EXPECT_TRUE(source.is_permanent());
  EXPECT_FALSE(source.world.has_topic);
  EXPECT_EQ(source.world.robot.description, "/other/robot_description");
  ASSERT_EQ(source.world.objects.size(), 2U);
  const WorldObject& table = source.world.objects[0].object;
  EXPECT_EQ(table.name, "table");
  EXPECT_EQ(table.frame, "hall");
  EXPECT_EQ(table.margin, 0.01);
  EXPECT_EQ(std::get<Box>(table.geometry[0].shape).size, Eigen::Vector3d(1.0, 2.0, 0.1));
  EXPECT_NEAR(table.X_BO.linear()(1, 0), 1.0, 1e-12);
  const WorldObjectConfig& wall = source.world.objects[1];
  EXPECT_EQ(wall.mesh, "package://cell/wall.stl");
  EXPECT_TRUE(wall.object.geometry.empty());
  EXPECT_EQ(wall.object.frame, "map");
  EXPECT_EQ(wall.object.margin, 0.5);
}

// A source of any type is to be searched quickly as far as queries measure.
TEST(SourceParameters, TheSearchDistanceIsThatOfTheQueries) {
  std::vector<std::string> warnings;
  XmlRpcValue tree = good();
  EXPECT_EQ(parse_parameters(tree, &warnings).sources.at(0).ingest.search_distance,
            QueryConfig().max_distance);
  tree["max_distance"] = 2.5;
  EXPECT_EQ(parse_parameters(tree, &warnings).sources.at(0).ingest.search_distance, 2.5);
}

TEST(WorldParameters, ATopicHasATimeout) {
  XmlRpcValue tree = good();
  XmlRpcValue& cell = tree["sources"]["cell"];
  cell["topic"] = "parts";
  cell["timeout"] = 2.0;
  std::vector<std::string> warnings;
  const ServerConfig config = parse_parameters(tree, &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  const SourceConfig& source = config.sources.at(0);
  EXPECT_EQ(source.topic, "parts");
  EXPECT_TRUE(source.world.has_topic);
  EXPECT_EQ(source.timeout, 2.0);
}

TEST(WorldParameters, MistakesAreNamed) {
  struct Case {
    std::vector<const char*> path;  // below the source
    XmlRpcValue value;
    const char* words;
  };
  XmlRpcValue nothing;
  nothing["type"] = "world";
  const Case cases[] = {
      {{"objects", "table", "shape"}, "cube", "~sources/cell/objects/table/shape is \"cube\""},
      {{"objects", "table", "size"},
       list({1.0, 0.0, 1.0}),
       "~sources/cell/objects/table/size is 0"},
      {{"objects", "table", "size"},
       list({1.0, 1.0}),
       "~sources/cell/objects/table/size is a list of 2"},
      {{"objects", "table", "size"},
       list({1.0, std::nan(""), 1.0}),
       "~sources/cell/objects/table/size is"},
      {{"objects", "table", "shape"}, "sphere", "~sources/cell/objects/table/radius is not set"},
      {{"objects", "wall", "mesh"}, "", "wall/mesh is not set"},
      {{"objects", "wall", "margin"}, -1.0, "wall/margin is -1 m"},
      {{"objects", "odd"}, 3, "~sources/cell/objects/odd is 3: a dictionary is needed"},
      {{"allowed_contacts"}, 3, "a list of pairs of strings is needed"},
      {{"file"}, "cell.scene", "an absolute path is needed"},
      {{}, nothing, "at least one of objects, file, topic or robot is needed"},
  };
  for (const Case& c : cases) {
    XmlRpcValue tree = good();
    XmlRpcValue* at = &tree["sources"]["cell"];
    for (const char* name : c.path) at = &(*at)[name];
    *at = c.value;
    std::vector<std::string> warnings;
    try {
      parse_parameters(tree, &warnings);
      ADD_FAILURE() << "no error; expected is " << c.words;
    } catch (const ParameterError& error) {
      test::expect_says(error.what(), c.words);
    }
  }
}

// A message that cannot be used is told once, however often it comes; others are told until there
// are too many to be read.
TEST(WorldFaultLog, TellsWhatIsNewAndNotTooMuch) {
  WorldFaultLog log;
  const auto start = WorldFaultLog::Clock::now();
  std::size_t lines = 0;
  for (int i = 0; i < 1000; ++i) {  // 20 s at 50 Hz
    lines += log.is_due("object 'a': no shape", start + i * std::chrono::milliseconds(20)) ? 1 : 0;
  }
  EXPECT_EQ(lines, 1U);
  EXPECT_TRUE(log.is_due("object 'b': no shape", start));
  for (int i = 0; i < 1000; ++i) lines += log.is_due(std::to_string(i), start) ? 1 : 0;
  EXPECT_EQ(lines, WorldFaultLog::kMost - 1);
  EXPECT_TRUE(log.is_due("object 'a': no shape", start + WorldFaultLog::kPeriod));
}

}  // namespace
}  // namespace ist
