#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Identifies the result of sample_pairs(): a hash over the shapes and places of the links, the
/// joints, the pairs, what is sampled, and the version of sampling. Packings do not matter.
std::string pair_samples_key(const RobotDescription& description, const RobotModel& model,
                             const Kinematics& kinematics, const std::vector<LinkPair>& pairs,
                             const PairSampling& sampling);

/// Results of sampling on disk, beside the packings, one file per key. A checksum detects files
/// that are truncated or damaged; they count as absent. Several processes may share a directory.
/// Thread safe.
class PairSamplesCache {
 public:
  /// @param directory  created when needed; empty turns the cache off
  explicit PairSamplesCache(std::string directory) : directory_(std::move(directory)) {}

  /// @param pairs    those that were given to the key
  /// @param warning  set to one sentence when there is a file that cannot be used
  std::optional<std::vector<SampledPair>> load(const std::string& key,
                                               const std::vector<LinkPair>& pairs,
                                               std::string* warning) const;
  /// @param warning  set to one sentence when the file cannot be written
  void store(const std::string& key, const std::vector<SampledPair>& sampled,
             std::string* warning) const;

 private:
  std::string path(const std::string& key) const;

  std::string directory_;
};

}  // namespace ist
