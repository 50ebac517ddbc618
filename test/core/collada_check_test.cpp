// Collada files whose lists of indices hold anything but whole numbers. Assimp 5.2 does not advance
// at such a character and adds zeros until memory ends: a file of 1 kB with "0.5" in <p> took 3 GB
// in 7 s, and went on.

#include "geometry/collada_check.h"

#include <gtest/gtest.h>

#include <string>

#include "internal/geometry/mesh_io.h"
#include "ist_proximity/geometry/error.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

// The file of a box with its first indices replaced.
std::string file_with(const std::string& indices) {
  std::string text = test::collada(test::box({1, 1, 1}));
  const std::size_t list = text.find("<p>") + 3;
  return text.replace(list, 1, indices);
}

TEST(ColladaCheck, IndicesMustBeWholeNumbers) {
  EXPECT_EQ(collada_fault(file_with("0")), "");
  EXPECT_EQ(collada_fault(file_with("+0")), "");
  EXPECT_EQ(collada_fault("no XML"), "");
  for (const std::string bad : {"x", "0.5", "0x1", "1e3", "5\xff\xff", "nan", ","}) {
    EXPECT_NE(collada_fault(file_with(bad)).find("whole numbers"), std::string::npos) << bad;
  }
}

TEST(ColladaCheck, ListsOfAnyElement) {
  const std::string list = "<COLLADA><a:mesh><a:polylist><a:vcount>3 x</a:vcount></a:polylist>";
  EXPECT_NE(collada_fault(list + "</a:mesh></COLLADA>").find("<vcount>"), std::string::npos);
  EXPECT_NE(collada_fault("<COLLADA><v><![CDATA[0 1 y]]></v></COLLADA>"), "");
  // Other text is not a list of indices.
  EXPECT_EQ(collada_fault("<COLLADA><author>p v</author><n>1.5 x</n></COLLADA>"), "");
}

TEST(ColladaCheck, LoadingSaysTheFileAndTheLine) {
  const test::TempDir folder;
  const std::string path = folder.write("damaged.dae", file_with("0.5"));
  try {
    load_mesh(path);
    FAIL() << "was read";
  } catch (const ModelError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("damaged.dae"), std::string::npos) << text;
    EXPECT_NE(text.find("(line "), std::string::npos) << text;
    EXPECT_NE(text.find("0.5"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace ist
