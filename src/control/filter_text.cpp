#include <cstddef>
#include <sstream>
#include <string>

#include "ist_proximity/control/velocity_filter.h"

namespace ist {
namespace {

std::string name_of(const RobotModel& model, std::size_t link) {
  return link < model.links.size() ? model.links[link].name : "link " + std::to_string(link);
}

// "gripper to source 0, 0.031 m".
void tell_row(const RowOrigin& origin, const RobotModel& model, Span<const LinkPair> pairs,
              std::ostringstream* text) {
  const auto index = static_cast<std::size_t>(origin.index);
  if (origin.is_pair && index < pairs.size()) {
    *text << name_of(model, pairs[index].first) << " to " << name_of(model, pairs[index].second);
  } else if (origin.is_pair) {
    *text << "pair " << index;
  } else {
    *text << name_of(model, index);
    if (origin.source >= 0) *text << " to source " << origin.source;
  }
  if (origin.state == LinkState::kUnknown) {
    *text << ", not known";
  } else {
    *text << ", " << origin.bound << " m";
  }
}

const char* what_was_done(FilterStatus status) {
  switch (status) {
    case FilterStatus::kFree:
      return "The command is given as it is.";
    case FilterStatus::kLimited:
      return "The nearest velocity that meets all bounds is given.";
    case FilterStatus::kScaled:
      return "The command is slowed down.";
    case FilterStatus::kStopped:
      return "The robot is stopped.";
    case FilterStatus::kFault:
      break;
  }
  return "The robot is stopped, because an input cannot be used.";
}

}  // namespace

const char* sentence(FilterReason reason) {
  switch (reason) {
    case FilterReason::kNone:
      return "";
    case FilterReason::kContradiction:
      return "No velocity meets all bounds and acceleration limits.";
    case FilterReason::kTime:
      return "The time was over before the nearest velocity was found.";
    case FilterReason::kCommand:
      return "The command needs one finite number for each joint.";
    case FilterReason::kPositions:
      return "The positions need one finite number for each joint.";
    case FilterReason::kRows:
      break;
  }
  return "The rows are not complete: see that the answers, poses and joints are those of one "
         "robot, "
         "and config_errors() of their configuration.";
}

std::string describe(const FilterAnswer& answer, const ConstraintRows& rows,
                     const RobotModel& model, Span<const LinkPair> pairs) {
  std::ostringstream text;
  text << what_was_done(answer.status);
  if (answer.reason != FilterReason::kNone) text << ' ' << sentence(answer.reason);
  const char* separator = " Held by: ";
  for (std::size_t k = 0; k < answer.rows.size(); ++k) {
    const std::size_t row = answer.rows[k];
    if (row >= rows.count || (k > 0 && row == answer.rows[k - 1])) continue;
    text << separator;
    tell_row(rows.origins[row], model, pairs, &text);
    separator = "; ";
  }
  for (const std::size_t joint : answer.joints) {
    text << separator << "a limit of joint " << joint;
    separator = "; ";
  }
  if (separator[0] == ';') text << '.';
  return text.str();
}

}  // namespace ist
