#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// The objects of known worlds that stand in the frame of a moving body of the robot, such as what
/// it holds: where they are in configurations other than that of now. A frame is a body's where it
/// has its name, and joints that move are between the body and the root. One thread.
class CarriedWorlds {
 public:
  /// The objects of one frame.
  struct Frame {
    std::size_t world, frame;  ///< the world, and its frame there
    std::size_t body;          ///< of the kinematics
    /// [m] A sphere about the objects, in the body's frame.
    Eigen::Vector3d center_B = Eigen::Vector3d::Zero();
    double radius = 0.0;
  };

  /// Takes worlds at their poses of now.
  /// @param worlds  as for WorldQuery::run, valid until the next call
  void take(Span<const PosedWorld* const> worlds, const Kinematics& kinematics);
  /// Places the objects that are carried. Where the pose of their body is not known, their world
  /// has none either, so that it makes every link UNKNOWN.
  void place(const BodyPoses& bodies);

  const std::vector<Frame>& frames() const { return frames_; }  ///< in which objects are carried
  /// All worlds; valid until the next take().
  Span<const PosedWorld* const> worlds() const { return worlds_; }

 private:
  std::vector<Frame> frames_;
  std::vector<PosedWorld> copies_;         ///< of worlds in which objects are carried
  std::vector<const PosedWorld*> worlds_;  ///< as they were given, or copies
  std::vector<std::size_t> copy_of_;       ///< by world: its place among the copies, if it has one
};

}  // namespace ist
