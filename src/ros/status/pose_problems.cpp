#include "ros/status/pose_problems.h"

#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

std::string quoted(const std::string& name) { return "'" + name + "'"; }

/// The end of a sentence: poses that are older than a cloud are why it has none at its stamp.
std::string older_than_cloud(const StampedLinkPoses& poses, const PoseSource* source,
                             const SourceSnapshot& snapshot) {
  const double older = seconds_between(poses.stamp, snapshot.stamp);
  if (older <= 0.0) return "";
  return format_text("; the newest poses are %.2f s older than that cloud", older) +
         (source ? ": " + source->hint() : "");
}

}  // namespace

std::vector<std::string> missing_poses(const RobotModel& robot,
                                       const std::vector<std::size_t>& monitored,
                                       const StampedLinkPoses& poses, const PoseSource* source) {
  std::vector<std::string> sentences, others;
  for (const std::size_t i : monitored) {
    if (poses.problems[i].empty()) continue;
    const std::string name = quoted(robot.links[i].name);
    if (sentences.empty()) {
      const bool needs_hint = source && !poses.problems[i].explained;
      sentences.push_back("link " + name + " has no pose: " + poses.problems[i].text +
                          (needs_hint ? "; " + source->hint() : ""));
    } else {
      others.push_back(name);
    }
  }
  if (!others.empty()) sentences.push_back("no pose either for " + join(others, ", "));
  return sentences;
}

std::string unfiltered_links(const RobotModel& robot, const std::vector<std::size_t>& monitored,
                             const StampedLinkPoses& poses, const PoseSource* pose_source,
                             const SourceSnapshot& snapshot, const std::string& source) {
  if (snapshot.filtered.empty()) return "";
  std::vector<std::string> unfiltered;
  for (const std::size_t i : monitored) {
    if (poses.known[i] && !snapshot.filtered[i]) unfiltered.push_back(quoted(robot.links[i].name));
  }
  if (unfiltered.empty()) return "";
  return "no pose at the stamp of the cloud in use from source '" + source +
         "', so that its own points are still in it: " + join(unfiltered, ", ") +
         older_than_cloud(poses, pose_source, snapshot);
}

}  // namespace ist
