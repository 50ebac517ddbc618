#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "internal/proximity/surroundings.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ros/cycle/add_on_cycle.h"
#include "ros/unknown_space/unknown_space.h"

namespace ist {

/// What is said of the space about a link that has not been seen.
struct UnknownSpaceAnswer {
  SeenShare seen;
  double lower_bound = std::numeric_limits<double>::quiet_NaN();  ///< [m] NaN: not asked
  Eigen::Vector3d direction = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  /// [m] The closest points of the link and of unknown space, in the fixed frame; NaN as direction.
  Eigen::Vector3d p_FCl = direction, p_FCo = direction;
};

/// Measures links against unknown space, beside the query of what has been seen. One thread.
class UnknownSpaceQuery : public AddOnCycle {
 public:
  /// @param is_only_reader  whether this is the one thread that calls watch.newest()
  /// @param is_obstacle     whether unknown space counts in `lower_bound`
  UnknownSpaceQuery(std::shared_ptr<const RobotModel> model,
                    std::shared_ptr<UnknownSpaceWatch> watch, bool is_only_reader,
                    bool is_obstacle);

  void set_model(std::shared_ptr<const RobotModel> model) override;

  /// @param poses  ages count from their stamp
  /// @returns empty, or a sentence on why all space counts as unknown, though some has been seen
  std::string run(const StampedLinkPoses& poses, const std::vector<bool>& known,
                  const std::string& fixed_frame, const LiveConfig& config) override;

  void fill(std::size_t link, double moved, ist_proximity::LinkProximity* message) const override;
  void draw(std::size_t link, std::size_t place, MarkerScene* scene) const override;

 private:
  double deepest(std::size_t link) const;
  void know_nothing();
  void look_about(std::size_t link, const Eigen::Isometry3d& X_FL, double now,
                  double influence_distance, const UnknownSnapshot& unknown);

  std::shared_ptr<const RobotModel> model_;
  const std::shared_ptr<UnknownSpaceWatch> watch_;
  const bool is_only_reader_, is_obstacle_;
  ProximityQuery query_;
  std::shared_ptr<const UnknownSnapshot> held_;  ///< by other readers
  CloudSnapshot placed_;                         ///< the boxes of a snapshot
  std::vector<LinkProximity> results_;
  /// By link. While nothing has been seen, it may be inside something everywhere.
  std::vector<UnknownSpaceAnswer> answers_;
  std::vector<std::optional<Surroundings>> surroundings_;  ///< by link, made when first needed
  double surroundings_distance_ = 0.0;                     ///< [m] that they are made with
  std::size_t next_ = 0;  ///< the link whose share is looked at next
};

}  // namespace ist
