#include "internal/robot/package_resolver.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "support/environment.h"
#include "support/errors.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

std::string manifest(const std::string& name) {
  return "<?xml version=\"1.0\"?>\n<package format=\"2\">\n  <name> " + name +
         " </name>\n</package>\n";
}

std::string one_package(const std::string& name) { return name == "robot" ? "/share/robot" : ""; }

std::string error_of(const std::string& uri, const PackageFinder& finder = one_package) {
  return test::error_of([&] { resolve_uri(uri, finder); });
}

using test::expect_says;

TEST(ResolveUri, resolvesPackagesFilesAndPaths) {
  EXPECT_EQ(resolve_uri("package://robot/meshes/a.stl", one_package), "/share/robot/meshes/a.stl");
  EXPECT_EQ(resolve_uri("package://robot/a/../b.stl", one_package), "/share/robot/a/../b.stl");
  EXPECT_EQ(resolve_uri("file:///tmp/a.stl", one_package), "/tmp/a.stl");
  EXPECT_EQ(resolve_uri("file://localhost/tmp/a.stl", one_package), "/tmp/a.stl");
  EXPECT_EQ(resolve_uri("file:/tmp/a.stl", one_package), "/tmp/a.stl");
  EXPECT_EQ(resolve_uri("/tmp/a.stl", one_package), "/tmp/a.stl");
}

TEST(ResolveUri, decodesPercentCodesInUris) {
  EXPECT_EQ(resolve_uri("file:///tmp/my%20robot%2fa.stl", one_package), "/tmp/my robot/a.stl");
  EXPECT_EQ(resolve_uri("package://robot/a%20b.stl", one_package), "/share/robot/a b.stl");
  EXPECT_EQ(resolve_uri("file:///tmp/100%.stl", one_package), "/tmp/100%.stl");
  EXPECT_EQ(resolve_uri("file:///tmp/%zz%4", one_package), "/tmp/%zz%4");
  EXPECT_EQ(resolve_uri("/tmp/a%20b.stl", one_package), "/tmp/a%20b.stl");  // a path, not a URI
}

TEST(ResolveUri, saysWhatIsWrong) {
  expect_says(error_of(""), "empty");
  expect_says(error_of("package://arm/a.stl"), "package 'arm'");
  expect_says(error_of("package://arm/a.stl"), "ROS_PACKAGE_PATH");
  expect_says(error_of("package://arm/a.stl"), "'package://arm/a.stl'");
  expect_says(error_of("package://arm/a.stl", {}), "package 'arm'");
  expect_says(error_of("package://robot"), "no file");
  expect_says(error_of("package://robot/"), "no file");
  expect_says(error_of("package:///a.stl"), "no package");
  expect_says(error_of("meshes/a.stl"), "relative");
  expect_says(error_of("http://host/a.stl"), "scheme 'http'");
  expect_says(error_of("model://robot/a.stl"), "scheme 'model'");
  expect_says(error_of("file://host/a.stl"), "host 'host'");
  expect_says(error_of("file://"), "no file");
  expect_says(error_of("file:///"), "no file");
  expect_says(error_of("file:a.stl"), "no file");
}

// `..` would open any file of the machine by a URI that looks like a package's.
TEST(ResolveUri, refusesPathsThatLeadOutOfThePackage) {
  for (const char* path : {"../b.stl", "a/../../b.stl", "%2e%2e/b.stl", "%2E./b.stl", "..%2fb.stl",
                           "a/../..//etc/passwd", "./../x", "a/.././../x/robot/b.stl", ".."}) {
    expect_says(error_of("package://robot/" + std::string(path)), "leads out of package 'robot'");
  }
  expect_says(error_of("package://../etc/passwd"), "no package");
  expect_says(error_of("package://robot/a%00.stl"), "character 0");
  expect_says(error_of("file:///tmp/a%00.stl"), "character 0");
  EXPECT_EQ(resolve_uri("package://robot/..a/b..stl", one_package), "/share/robot/..a/b..stl");
  // The message may go to a terminal and into a topic.
  expect_says(error_of("package://arm/\x1b[2J\n\xff.stl"), "'package://arm/?[2J??.stl'");
}

class EnvironmentPackages : public testing::Test {
 protected:
  std::string find(const std::string& path, const std::string& package) {
    const test::Environment variable("ROS_PACKAGE_PATH", path.c_str());
    return environment_package_finder()(package);
  }
  std::string folder(const std::string& name) { return dir_.file(name); }

  test::TempDir dir_;
};

TEST_F(EnvironmentPackages, findsByTheNameInTheManifest) {
  dir_.write("src/direct/package.xml", manifest("direct"));
  dir_.write("src/stack/deep/other_folder_name/package.xml", manifest("deep"));
  EXPECT_EQ(find(folder("src"), "direct"), folder("src/direct"));
  EXPECT_EQ(find(folder("src"), "deep"), folder("src/stack/deep/other_folder_name"));
  EXPECT_EQ(find(folder("src"), "other_folder_name"), "");
  EXPECT_EQ(find(folder("src/direct"), "direct"), folder("src/direct"));  // the path is the package
}

TEST_F(EnvironmentPackages, earlierFoldersHideLaterOnes) {
  dir_.write("overlay/a/b/robot/package.xml", manifest("robot"));
  dir_.write("underlay/robot/package.xml", manifest("robot"));
  EXPECT_EQ(find(folder("overlay") + ":" + folder("underlay"), "robot"),
            folder("overlay/a/b/robot"));
  EXPECT_EQ(find(folder("underlay") + ":" + folder("overlay"), "robot"), folder("underlay/robot"));
}

TEST_F(EnvironmentPackages, looksWhereRospackLooks) {
  dir_.write("src/outer/package.xml", manifest("outer"));
  dir_.write("src/outer/inner/package.xml", manifest("inner"));
  dir_.write("src/.hidden/robot/package.xml", manifest("hidden"));
  dir_.write("src/ignored/CATKIN_IGNORE", "");
  dir_.write("src/ignored/robot/package.xml", manifest("ignored"));
  dir_.write("src/flat/rospack_nosubdirs", "");
  dir_.write("src/flat/robot/package.xml", manifest("flat"));
  dir_.write("src/rosbuild/manifest.xml", "<package/>");
  dir_.write("src/broken/package.xml", "<package><name>");
  for (const char* name : {"inner", "hidden", "ignored", "flat", "broken"}) {
    EXPECT_EQ(find(folder("src"), name), "") << name;
  }
  EXPECT_EQ(find(folder("src"), "outer"), folder("src/outer"));
  EXPECT_EQ(find(folder("src"), "rosbuild"), folder("src/rosbuild"));
}

TEST_F(EnvironmentPackages, survivesLoopsAndNonsenseInThePath) {
  dir_.write("src/group/robot/package.xml", manifest("robot"));
  std::filesystem::create_directory_symlink(dir_.path() / "src", dir_.path() / "src/group/loop");
  EXPECT_EQ(find("::/does/not/exist:" + folder("src") + ":", "robot"), folder("src/group/robot"));
  EXPECT_EQ(find(folder("src"), "nobody"), "");
  EXPECT_EQ(find("", "robot"), "");
  EXPECT_EQ(find(folder("src"), ""), "");
}

TEST_F(EnvironmentPackages, finderCanBeSharedByThreads) {
  for (int i = 0; i < 20; ++i) {
    const std::string name = "p" + std::to_string(i);
    dir_.write("src/group/" + name + "/package.xml", manifest(name));
  }
  const test::Environment variable("ROS_PACKAGE_PATH", folder("src").c_str());
  const PackageFinder finder = environment_package_finder();
  std::vector<std::string> found(20);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < found.size(); ++i) {
    threads.emplace_back([&, i] { found[i] = finder("p" + std::to_string(i)); });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i], folder("src/group/p" + std::to_string(i)));
  }
}

}  // namespace
}  // namespace ist
