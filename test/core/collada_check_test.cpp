// Collada files that assimp 5.2 does not survive. At a character that is no number it does not
// advance and adds indices until memory ends: a file of 1 kB with "0.5" in <p> took 3 GB in 7 s,
// and went on. An accessor that reads past its array is a segmentation fault, and triangles without
// <p> are an assertion that ends the program.

#include "geometry/collada_check.h"

#include <gtest/gtest.h>

#include <string>

#include "internal/geometry/mesh_io.h"
#include "support/errors.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using test::expect_says;

// The file of a box with a part of its text replaced.
std::string changed(const std::string& from, const std::string& to) {
  std::string text = test::collada(test::box({1, 1, 1}));
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// The same with other first indices.
std::string file_with(const std::string& indices) { return changed("<p>0", "<p>" + indices); }

TEST(ColladaCheck, IndicesMustBeWholeNumbers) {
  EXPECT_EQ(collada_fault(file_with("0")), "");
  EXPECT_EQ(collada_fault(file_with("+0")), "");
  // Assimp reads on where XML is not well-formed, and meets the same indices.
  const std::string broken = file_with("0.5");
  expect_says(collada_fault(broken.substr(0, broken.rfind('<'))), "well-formed");
  for (const std::string bad : {"x", "0.5", "0x1", "1e3", "5\xff\xff", "nan", ","}) {
    SCOPED_TRACE(bad);
    expect_says(collada_fault(file_with(bad)), "whole numbers");
  }
}

TEST(ColladaCheck, ListsOfAnyElement) {
  const std::string list = "<COLLADA><a:mesh><a:poly><a:vcount>3 x</a:vcount></a:poly>";
  expect_says(collada_fault(list + "</a:mesh></COLLADA>"), "<vcount>");
  EXPECT_NE(collada_fault("<COLLADA><v><![CDATA[0 1 y]]></v></COLLADA>"), "");
  // Other text is not a list of indices.
  EXPECT_EQ(collada_fault("<COLLADA><author>p v</author><n>1.5 x</n></COLLADA>"), "");
}

TEST(ColladaCheck, AccessorsStayInTheirArray) {
  // 8 vertices are 24 numbers.
  for (const std::string count :
       {"", "count=\"\"", "count=\"x\"", "count=\"-1\"", "count=\"0\"", "count=\"23\""}) {
    expect_says(collada_fault(changed("count=\"24\"", count)), "<accessor>");
  }
  for (const std::string stride : {"4", "4000000000", "18446744073709551615"}) {
    EXPECT_NE(collada_fault(changed("stride=\"3\"", "stride=\"" + stride + "\"")), "") << stride;
  }
  EXPECT_NE(collada_fault(changed("stride=\"3\"", "stride=\"3\" offset=\"1\"")), "");
  EXPECT_NE(collada_fault(changed("count=\"8\"", "count=\"18446744073709551615\"")), "");
  // An array may hold more, and names of joints are not coordinates.
  EXPECT_EQ(collada_fault(changed("count=\"8\"", "count=\"7\"")), "");
  EXPECT_EQ(
      collada_fault("<COLLADA><source><Name_array count=\"2\">a b</Name_array><technique_common>"
                    "<accessor count=\"2\"/></technique_common></source></COLLADA>"),
      "");
}

TEST(ColladaCheck, PrimitivesHaveTheirIndices) {
  expect_says(collada_fault("<COLLADA><triangles count=\"2\"/></COLLADA>"), "<triangles>");
  EXPECT_NE(collada_fault("<COLLADA><polygons count=\"2\"><p>0 1 2</p></polygons></COLLADA>"), "");
  EXPECT_EQ(collada_fault("<COLLADA><polygons count=\"1\"><p>0 1 2</p></polygons></COLLADA>"), "");
  EXPECT_EQ(collada_fault("<COLLADA><triangles count=\"0\"/></COLLADA>"), "");
  EXPECT_NE(collada_fault("<COLLADA><triangles count=\"0\"><p>0 1 2</p></triangles></COLLADA>"),
            "");
  for (const std::string name : {"tristrips", "trifans"}) {
    const std::string strip = "<COLLADA><" + name + " count=\"1\"><input offset=\"1\"/><p>";
    EXPECT_NE(collada_fault(strip + "0 0 1 0 2</p></" + name + "></COLLADA>"), "");
    EXPECT_EQ(collada_fault(strip + "0 0 1 0 2 0</p></" + name + "></COLLADA>"), "");
  }
}

TEST(ColladaCheck, NothingIsLeftOut) {
  expect_says(collada_fault("<COLLADA><node><skew>45 1 0 0 0 1 0</skew></node></COLLADA>"),
              "<skew>");
  for (const std::string name : {"instance_geometry", "instance_node", "instance_controller"}) {
    const std::string part = "<COLLADA><" + name + " url=\"#a\"/>";
    expect_says(collada_fault(part + "</COLLADA>"), "#a");
    EXPECT_EQ(collada_fault(part + "<geometry id=\"a\"/></COLLADA>"), "");
  }
}

TEST(ColladaCheck, LoadingSaysTheFileAndTheLine) {
  const test::TempDir folder;
  const std::string path = folder.write("damaged.dae", file_with("0.5"));
  const std::string text = test::error_of([&] { load_mesh(path); });
  for (const char* part : {"damaged.dae", "(line ", "0.5"}) expect_says(text, part);
}

}  // namespace
}  // namespace ist
