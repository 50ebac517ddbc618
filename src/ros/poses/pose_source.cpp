#include "ros/poses/pose_source.h"

#include <algorithm>

namespace ist {

void StampedLinkPoses::reset(const ros::Time& now, std::size_t links) {
  stamp = std::max(stamp, now);
  X_FL.resize(links, Eigen::Isometry3d::Identity());
  known.assign(links, false);
  problems.assign(links, PoseProblem());
  doubts.clear();
}

void StampedLinkPoses::set_problem(const std::vector<bool>& wanted, const PoseProblem& problem) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i]) problems[i] = problem;
  }
}

void StampedLinkPoses::add_doubt(const std::string& doubt) {
  const bool is_new = std::find(doubts.begin(), doubts.end(), doubt) == doubts.end();
  if (is_new && !doubt.empty()) doubts.push_back(doubt);
}

std::size_t StampedLinkPoses::count_known() const {
  return static_cast<std::size_t>(std::count(known.begin(), known.end(), true));
}

}  // namespace ist
