#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

/// The main() of a fuzz target where there is no libFuzzer: one test for each kept seed, and one
/// for no bytes at all. Each seed is a file in the folder that --seeds names.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

class Seed : public testing::Test {
 public:
  explicit Seed(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {}
  void TestBody() override { EXPECT_EQ(LLVMFuzzerTestOneInput(bytes_.data(), bytes_.size()), 0); }

 private:
  std::vector<std::uint8_t> bytes_;
};

void add(const std::string& name, const std::vector<std::uint8_t>& bytes) {
  testing::RegisterTest("Seeds", name.c_str(), nullptr, nullptr, __FILE__, __LINE__,
                        [bytes]() -> testing::Test* { return new Seed(bytes); });
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const std::string option = "--seeds=";
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.rfind(option, 0) != 0) continue;
    for (const auto& entry : std::filesystem::directory_iterator(argument.substr(option.size()))) {
      files.push_back(entry.path());
    }
  }
  if (files.empty()) {
    std::fprintf(stderr, "no seeds: --seeds=FOLDER names a folder with files\n");
    return 1;
  }
  std::sort(files.begin(), files.end());
  add("no_bytes", {});
  for (const std::filesystem::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    add(file.filename().string(), {std::istreambuf_iterator<char>(in), {}});
  }
  return RUN_ALL_TESTS();
}
