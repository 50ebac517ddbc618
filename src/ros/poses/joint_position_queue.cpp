#include "ros/poses/joint_position_queue.h"

namespace ist {
namespace {

constexpr std::size_t kMaxWaiting = 10;

}  // namespace

void JointPositionQueue::reset(std::size_t joints) {
  newest_.assign(joints, JointPosition());
  taken_ = newest_;
  waiting_.clear();
}

std::size_t JointPositionQueue::push() {
  std::size_t dropped = 0;
  if (waiting_.size() == kMaxWaiting) {
    dropped = waiting_.size();
    waiting_.clear();
  }
  waiting_.push_back(newest_);
  return dropped;
}

void JointPositionQueue::take_next() {
  if (waiting_.empty()) {
    taken_ = newest_;
    return;
  }
  taken_.swap(waiting_.front());
  waiting_.pop_front();
}

}  // namespace ist
