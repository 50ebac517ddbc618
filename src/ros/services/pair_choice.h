#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ros/model/model_state.h"

namespace ist {

/// Why a pair of links is watched or left out; the values are those of LinkPair.msg.
enum class PairReason { kWatched, kAdjacent, kSrdf = 3, kAtRest, kUnusable };

struct ChosenPair {
  LinkPair pair;
  PairReason reason;
};

/// Decides about every pair of links of ~self_proximity, see with_paired().
struct PairChoice {
  std::vector<ChosenPair> all;

  std::vector<LinkPair> watched() const;
  std::string text(const RobotModel& robot) const;  ///< a sentence for the log
};

/// @param monitoring  the model: ready, with kinematics
/// @param cancelled  asked now and then; true ends the work, whose result is of no use then. May be
///                   empty
PairChoice choose_pairs(const std::shared_ptr<const ModelState>& monitoring,
                        const std::function<bool()>& cancelled = {});

}  // namespace ist
