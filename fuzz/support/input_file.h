#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "support/check.h"

namespace ist::fuzz {

/// A file in the temporary folder, for functions that take a path. Its name ends as
/// given; it is removed with the object.
class InputFile {
 public:
  explicit InputFile(const std::string& ending) {
    const char* folder = std::getenv("TMPDIR");  // scripts/fuzz names one in memory
    path_ = std::string(folder != nullptr ? folder : "/tmp") + "/ist_fuzz_XXXXXX" + ending;
    const int file = mkstemps(path_.data(), static_cast<int>(ending.size()));
    FUZZ_CHECK(file >= 0, "no temporary file %s", path_.c_str());
    close(file);
  }
  ~InputFile() { unlink(path_.c_str()); }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  void write(const std::uint8_t* data, std::size_t size) const {
    std::ofstream(path_, std::ios::binary | std::ios::trunc)
        .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace ist::fuzz
