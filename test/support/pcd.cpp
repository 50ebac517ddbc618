#include "support/pcd.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace ist::test {
namespace {

// Decompresses LibLZF's format: literal runs and back references.
std::vector<std::uint8_t> decompress_lzf(const std::vector<std::uint8_t>& in, std::size_t size) {
  std::vector<std::uint8_t> out;
  out.reserve(size);
  for (std::size_t i = 0; i < in.size();) {
    const std::size_t control = in[i++];
    if (control < 32) {
      for (std::size_t k = 0; k <= control; ++k) out.push_back(in.at(i++));
      continue;
    }
    std::size_t length = control >> 5U;
    if (length == 7) length += in.at(i++);
    std::size_t distance = ((control & 31U) << 8U) + 1;
    distance += in.at(i++);
    for (std::size_t k = 0; k < length + 2; ++k) out.push_back(out.at(out.size() - distance));
  }
  if (out.size() != size) throw std::runtime_error("LZF data of the wrong size");
  return out;
}

}  // namespace

std::vector<Eigen::Vector3f> read_pcd(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  std::vector<std::string> fields;
  std::size_t points = 0;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string key, word;
    words >> key;
    if (key == "FIELDS") {
      while (words >> word) fields.push_back(word);
    } else if (key == "POINTS") {
      words >> points;
    } else if (key == "DATA") {
      words >> word;
      if (word != "binary_compressed") throw std::runtime_error(path + ": DATA " + word);
      break;
    }
  }
  std::uint32_t sizes[2];
  if (!file.read(reinterpret_cast<char*>(sizes), 8))
    throw std::runtime_error("cannot read " + path);
  std::vector<std::uint8_t> packed(sizes[0]);
  file.read(reinterpret_cast<char*>(packed.data()), static_cast<std::streamsize>(packed.size()));
  const std::vector<std::uint8_t> data = decompress_lzf(packed, sizes[1]);
  std::vector<Eigen::Vector3f> cloud(points);
  for (std::size_t f = 0; f < fields.size(); ++f) {
    const int axis = fields[f] == "x" ? 0 : fields[f] == "y" ? 1 : fields[f] == "z" ? 2 : -1;
    for (std::size_t i = 0; axis >= 0 && i < points; ++i) {
      std::memcpy(&cloud[i][axis], &data.at(4 * (f * points + i)), 4);
    }
  }
  return cloud;
}

}  // namespace ist::test
