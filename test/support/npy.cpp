#include "support/npy.h"

#include <cstdint>
#include <fstream>
#include <regex>
#include <stdexcept>

namespace ist::test {

Npy read_npy(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[8];
  std::uint16_t header_size = 0;
  if (!file.read(magic, 8) || !file.read(reinterpret_cast<char*>(&header_size), 2)) {
    throw std::runtime_error("cannot read " + path);
  }
  std::string header(header_size, ' ');
  file.read(&header[0], header_size);
  const bool is_double = header.find("<f8") != std::string::npos;
  if (!is_double && header.find("<f4") == std::string::npos) {
    throw std::runtime_error(path + ": neither <f4 nor <f8");
  }
  Npy array;
  std::size_t count = 1;
  const std::string shape = header.substr(header.find('(') + 1);
  const std::regex number("[0-9]+");
  const std::string dimensions = shape.substr(0, shape.find(')'));
  for (std::sregex_iterator i(dimensions.begin(), dimensions.end(), number), end; i != end; ++i) {
    array.shape.push_back(std::stoul(i->str()));
    count *= array.shape.back();
  }
  array.values.resize(count);
  for (double& value : array.values) {
    float single = 0.0F;
    if (is_double) {
      file.read(reinterpret_cast<char*>(&value), 8);
    } else {
      file.read(reinterpret_cast<char*>(&single), 4);
      value = static_cast<double>(single);
    }
  }
  if (!file) throw std::runtime_error(path + ": truncated");
  return array;
}

}  // namespace ist::test
