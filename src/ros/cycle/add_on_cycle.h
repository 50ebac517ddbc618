#pragma once

#include <ist_proximity/LinkProximity.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "ros/output/markers.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// The part of an add-on in the cycles of one model, after the distances to obstacles. One thread.
class AddOnCycle {
 public:
  virtual ~AddOnCycle() = default;

  /// Takes finer packings of the same robot.
  virtual void set_model(std::shared_ptr<const RobotModel> model) = 0;

  /// @param poses   of the links, in `fixed_frame`
  /// @param known   by link: whether it is measured
  /// @param config  its deadline [s] is that of the cycle
  /// @returns empty, or a sentence on what is not known
  virtual std::string run(const StampedLinkPoses& poses, const std::vector<bool>& known,
                          const std::string& fixed_frame, const LiveConfig& config) = 0;

  /// Adds what the last run() found of a link to its answer, which is not UNKNOWN.
  /// @param moved  [m] how far the link's points may have moved from its pose
  virtual void fill(std::size_t link, double moved,
                    ist_proximity::LinkProximity* message) const = 0;
  /// Adds what the last run() found of a link to what is drawn.
  /// @param place  of the link in the message
  virtual void draw(std::size_t link, std::size_t place, MarkerScene* scene) const = 0;
};

}  // namespace ist
