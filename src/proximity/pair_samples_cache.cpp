#include "internal/proximity/pair_samples_cache.h"

#include <cstdio>
#include <filesystem>

#include "internal/geometry/regular_file.h"
#include "internal/packing/byte_stream.h"
#include "internal/packing/packing_cache.h"

namespace ist {
namespace {

// Raise it whenever the same robot is sampled differently.
constexpr std::uint32_t kSamplingVersion = 2;
constexpr char kMagic[] = "ISTPAIR";  // 8 bytes with its final 0

void write_pose(const Eigen::Isometry3d& X, ByteWriter* out) {
  for (int column = 0; column < 4; ++column) out->vector(X.matrix().col(column).head<3>());
}

void write_text(const std::string& text, ByteWriter* out) {
  out->u64(text.size());
  out->raw(text.data(), text.size());
}

// The file: magic, key, number of pairs, counts by pair, checksum of everything before it.
std::string serialized(const std::string& key, const std::vector<SampledPair>& sampled) {
  ByteWriter out;
  out.raw(kMagic, sizeof(kMagic));
  write_text(key, &out);
  out.u64(sampled.size());
  for (const SampledPair& pair : sampled) {
    out.u64(pair.contacts);
    out.u64(pair.measured);
  }
  out.u64(out.hash(0));
  return out.bytes();
}

// @returns empty, or why the bytes cannot be used
std::string parse(const std::string& bytes, const std::string& key,
                  std::vector<SampledPair>* sampled) {
  const std::string expected = serialized(key, *sampled);
  const std::size_t head = sizeof(kMagic) + 8 + key.size() + 8;
  if (bytes.size() != expected.size() || bytes.compare(0, head, expected, 0, head) != 0) {
    return "it is of another format, or is truncated";
  }
  ByteWriter checked;
  checked.raw(bytes.data(), bytes.size() - 8);
  ByteReader in(bytes);
  in.raw(head);
  for (SampledPair& pair : *sampled) {
    pair.contacts = in.u64();
    pair.measured = in.u64();
    if (pair.contacts > pair.measured) return "it has more contacts than configurations";
  }
  return in.u64() == checked.hash(0) ? "" : "its checksum is wrong";
}

}  // namespace

std::string pair_samples_key(const RobotDescription& description, const RobotModel& model,
                             const Kinematics& kinematics, const std::vector<LinkPair>& pairs,
                             const PairSampling& sampling) {
  ByteWriter out;
  out.u32(kSamplingVersion);
  out.u64(sampling.configurations);
  out.u64(sampling.seed);
  for (const LinkDescription& link : description.links) {
    write_text(link.name, &out);
    for (const GeometryElement& element : link.geometry) {
      write_text(packing_key(element.shape, {}), &out);
      write_pose(element.X_LE, &out);
    }
  }
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    write_text(joint.name, &out);
    out.u32(static_cast<std::uint32_t>(joint.type));
    out.u64(joint.parent);
    out.u64(joint.source);
    write_pose(joint.X_PJ, &out);
    out.vector(joint.axis);
    for (const double value : {joint.lower, joint.upper, joint.multiplier, joint.offset}) {
      out.f64(value);
    }
  }
  for (const LinkPair& pair : pairs) {
    write_text(model.links[pair.first].name, &out);
    write_text(model.links[pair.second].name, &out);
  }
  char text[33];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(out.hash(1)),
                static_cast<unsigned long long>(out.hash(2)));
  return text;
}

std::string PairSamplesCache::path(const std::string& key) const {
  return (std::filesystem::path(directory_) / (key + ".istpairs")).string();
}

std::optional<std::vector<SampledPair>> PairSamplesCache::load(const std::string& key,
                                                               const std::vector<LinkPair>& pairs,
                                                               std::string* warning) const {
  if (directory_.empty()) return std::nullopt;
  std::error_code error;
  if (!std::filesystem::exists(path(key), error) && !error) return std::nullopt;
  std::vector<SampledPair> sampled;
  sampled.reserve(pairs.size());
  for (const LinkPair& pair : pairs) sampled.push_back({pair, 0, 0});
  std::string bytes;
  std::string problem = read_regular_file(path(key), serialized(key, sampled).size(), &bytes);
  problem = problem.empty() ? parse(bytes, key, &sampled) : "it " + problem;
  if (problem.empty()) return sampled;
  *warning = "the file of sampled pairs '" + path(key) + "' is not used: " + problem;
  return std::nullopt;
}

void PairSamplesCache::store(const std::string& key, const std::vector<SampledPair>& sampled,
                             std::string* warning) const {
  if (directory_.empty()) return;
  const std::string problem = write_cache_file(directory_, path(key), serialized(key, sampled));
  if (problem.empty()) return;
  *warning = "the file of sampled pairs '" + path(key) + "' cannot be written (" + problem +
             "); pairs will be sampled again next time";
}

}  // namespace ist
