#include "ist_proximity/cloud/octree.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <utility>

#include "internal/geometry/regular_file.h"

namespace ist {
namespace {

constexpr int kDepth = 16;                          // levels of every OcTree
constexpr std::int32_t kHalf = 1 << (kDepth - 1);   // smallest leaves from the middle to a side
constexpr double kSmallest = 1e-6, kLargest = 1e3;  // [m] resolutions

class Reader {
 public:
  Reader(const OctreeData& data, const OctreeLimits& limits, Octree* octree)
      : next_(data.data),
        end_(data.data + data.size),
        resolution_(data.resolution),
        limits_(limits),
        out_(*octree) {}

  // Reads a node and its descendants. The recursion ends at the tree's full depth.
  bool binary_node(const Eigen::Vector3i& low, int depth) {
    ++out_.nodes;
    if (end_ - next_ < 2) return fail("ends in the middle of the tree");
    const auto codes = static_cast<std::uint32_t>(next_[0] | next_[1] << 8);
    next_ += 2;
    if (depth == kDepth && codes != 0) return fail("is deeper than 16 levels");
    for (int child = 0; child < 8; ++child) {
      const std::uint32_t code = codes >> (2 * child) & 3U;
      if (code == kFree) {
        ++out_.nodes;
        if (!add_free(corner(low, depth + 1, child), depth + 1)) return false;
      } else if (code == kOccupied) {
        ++out_.nodes;
        if (!add(corner(low, depth + 1, child), depth + 1)) return false;
      } else if (code == kInner && !binary_node(corner(low, depth + 1, child), depth + 1)) {
        return false;
      }
    }
    return true;
  }

  bool full_node(const Eigen::Vector3i& low, int depth) {
    ++out_.nodes;
    float log_odds;
    if (end_ - next_ < static_cast<std::ptrdiff_t>(sizeof log_odds) + 1) {
      return fail("ends in the middle of the tree");
    }
    std::memcpy(&log_odds, next_, sizeof log_odds);
    const std::uint8_t children = next_[sizeof log_odds];
    next_ += sizeof log_odds + 1;
    if (!std::isfinite(log_odds)) return fail("holds a log-odds value that is not finite");
    if (children == 0) {
      return log_odds >= 0.0F ? add(low, depth) : add_free(low, depth);
    }
    if (depth == kDepth) return fail("is deeper than 16 levels");
    for (int child = 0; child < 8; ++child) {
      if ((children >> child & 1) == 0) continue;
      if (!full_node(corner(low, depth + 1, child), depth + 1)) return false;
    }
    return true;
  }

  std::size_t remaining() const { return static_cast<std::size_t>(end_ - next_); }
  const std::string& fault() const { return fault_; }

 private:
  static constexpr std::uint32_t kFree = 1, kOccupied = 2, kInner = 3;

  bool fail(std::string what) {
    fault_ = std::move(what);
    return false;
  }

  static Eigen::Vector3i corner(const Eigen::Vector3i& low, int depth, int child) {
    const std::int32_t size = 1 << (kDepth - depth);
    return low + size * Eigen::Vector3i(child & 1, child >> 1 & 1, child >> 2 & 1);
  }

  // Adds an occupied leaf. Its corners are whole numbers times the resolution, so that neighbours
  // meet exactly.
  bool add(const Eigen::Vector3i& low, int depth) { return keep(low, depth, &out_.occupied); }

  bool add_free(const Eigen::Vector3i& low, int depth) {
    ++out_.free;
    return !limits_.keep_free || keep(low, depth, &out_.free_leaves);
  }

  bool keep(const Eigen::Vector3i& low, int depth, std::vector<Eigen::AlignedBox3d>* leaves) {
    if (out_.occupied.size() + out_.free_leaves.size() >= limits_.max_leaves) {
      return fail(std::string("has more ") + (limits_.keep_free ? "" : "occupied ") +
                  "leaves than allowed, which are " + std::to_string(limits_.max_leaves) +
                  " (max_leaves)");
    }
    const Eigen::Vector3i high = low.array() + (1 << (kDepth - depth));
    const Eigen::AlignedBox3d box(resolution_ * low.cast<double>(),
                                  resolution_ * high.cast<double>());
    const Eigen::Vector3d farthest = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs());
    if (!(farthest.maxCoeff() <= limits_.max_position)) return fail(too_far(box));
    leaves->push_back(box);
    return true;
  }

  std::string too_far(const Eigen::AlignedBox3d& box) const {
    const Eigen::Vector3d &low = box.min(), &high = box.max();
    std::ostringstream text;
    text << (limits_.keep_free ? "has a leaf from (" : "has an occupied leaf from (") << low.x()
         << ", " << low.y() << ", " << low.z() << ") to (" << high.x() << ", " << high.y() << ", "
         << high.z() << ") m, farther out than " << limits_.max_position << " m (max_position)";
    return text.str();
  }

  const std::uint8_t *next_, *end_;
  double resolution_;
  const OctreeLimits& limits_;
  Octree& out_;
  std::string fault_;
};

// Reads the tree; `remaining` bytes follow it.
std::string read(const OctreeData& data, const OctreeLimits& limits, Octree* octree,
                 std::size_t* remaining) {
  *octree = Octree();
  *remaining = 0;
  if (data.id != "OcTree") {
    constexpr std::size_t kShown = 40;  // characters of what may be any text
    return "the tree's type is '" + data.id.substr(0, kShown) + "', it must be 'OcTree'.";
  }
  if (!(data.resolution >= kSmallest && data.resolution <= kLargest)) {
    std::ostringstream text;
    text << "resolution is " << data.resolution << " m, it must be from 1e-6 to 1000 m.";
    return text.str();
  }
  if (data.size > limits.max_bytes) {
    return "the tree's data has " + std::to_string(data.size) + " bytes, allowed are at most " +
           std::to_string(limits.max_bytes) + " (max_bytes).";
  }
  if (data.size == 0) return {};
  Reader reader(data, limits, octree);
  const Eigen::Vector3i low = Eigen::Vector3i::Constant(-kHalf);
  const bool whole = data.is_binary ? reader.binary_node(low, 0) : reader.full_node(low, 0);
  if (!whole) {
    return "the tree's data of " + std::to_string(data.size) + " bytes " + reader.fault() + ".";
  }
  *remaining = reader.remaining();
  return {};
}

struct Header {
  std::string id;
  bool is_binary = false;
  std::size_t nodes = 0;
  double resolution = 0.0;
};

// Takes the next line; false at the end.
bool next_line(const std::string& bytes, std::size_t* at, std::string* line) {
  if (*at >= bytes.size()) return false;
  const std::size_t end = std::min(bytes.find('\n', *at), bytes.size());
  *line = bytes.substr(*at, end - *at);
  *at = std::min(end + 1, bytes.size());
  return true;
}

// Reads lines of a key and a value, up to the one after which the data begins.
// @param data_begin  where it begins
std::string read_header(const std::string& bytes, Header* header, std::size_t* data_begin) {
  std::string line;
  next_line(bytes, data_begin, &line);
  header->is_binary = line.rfind("# Octomap OcTree binary file", 0) == 0;
  if (!header->is_binary && line.rfind("# Octomap OcTree file", 0) != 0) {
    return "is no OctoMap file: it does not begin with '# Octomap OcTree'.";
  }
  constexpr int kMostLines = 1000;
  for (int i = 0; i < kMostLines && next_line(bytes, data_begin, &line); ++i) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "data") return {};
    if (key == "id") words >> header->id;
    if (key == "size") words >> header->nodes;
    if (key == "res") words >> header->resolution;
  }
  return "is cut off: its header does not end with 'data'.";
}

}  // namespace

std::string read_octree(const OctreeData& data, Octree* octree, const OctreeLimits& limits) {
  std::size_t remaining = 0;
  std::string fault = read(data, limits, octree, &remaining);
  if (!fault.empty() || remaining == 0) return fault;
  return "the tree ends " + std::to_string(remaining) + " bytes before its data of " +
         std::to_string(data.size) + " bytes does.";
}

std::string read_octree_file(const std::string& path, Octree* octree, const OctreeLimits& limits,
                             double* resolution) {
  const std::string name = "map file '" + path + "' ";
  std::string bytes;
  std::string fault = read_regular_file(path, limits.max_bytes, &bytes);
  if (!fault.empty()) return name + "cannot be read: it " + fault + ".";
  Header header;
  std::size_t data_begin = 0;
  fault = read_header(bytes, &header, &data_begin);
  if (!fault.empty()) return name + fault;
  const std::size_t data_size = bytes.size() - data_begin;
  OctreeData data;
  data.id = header.id;
  data.is_binary = header.is_binary;
  data.resolution = header.resolution;
  if (resolution != nullptr) *resolution = header.resolution;
  data.data = reinterpret_cast<const std::uint8_t*>(bytes.data()) + data_begin;
  data.size = header.nodes > 0 ? data_size : 0;
  if (header.nodes > 0 && data_size == 0) return name + "is cut off: it holds no data.";
  std::size_t remaining = 0;
  const std::string damage = read(data, limits, octree, &remaining);
  if (!damage.empty()) return name + "cannot be used: " + damage;
  if (octree->nodes != header.nodes) {
    return name + "is damaged: its header says " + std::to_string(header.nodes) +
           " nodes, its data holds " + std::to_string(octree->nodes) + ".";
  }
  return {};
}

}  // namespace ist
