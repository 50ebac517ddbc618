#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "internal/proximity/surroundings.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ros/input/unknown_space.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/pose_source.h"

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
class UnknownSpaceQuery {
 public:
  /// @param watch   outlives this
  /// @param reader  whether this is the one thread that calls watch.newest()
  UnknownSpaceQuery(std::shared_ptr<const RobotModel> model, UnknownSpaceWatch* watch,
                    bool is_only_reader);

  /// @param poses          of the links, in `fixed_frame`; ages count from their stamp
  /// @param known          as ProximityQuery::run()
  /// @param config         its deadline [s] is for this query
  /// @returns empty, or a sentence on why all space counts as unknown, though some has been seen
  std::string run(const StampedLinkPoses& poses, const std::vector<bool>& known,
                  const std::string& fixed_frame, const QueryConfig& config,
                  double influence_distance);

  /// The answer for a link of the last run(). While nothing has been seen, it may be inside
  /// something everywhere.
  const UnknownSpaceAnswer& answer(std::size_t link) const { return answers_[link]; }

  void set_model(std::shared_ptr<const RobotModel> model);

 private:
  double deepest(std::size_t link) const;
  void know_nothing();
  void look_about(std::size_t link, const Eigen::Isometry3d& X_FL, double now,
                  double influence_distance, const UnknownSnapshot& unknown);

  std::shared_ptr<const RobotModel> model_;
  UnknownSpaceWatch& watch_;
  const bool is_only_reader_;
  ProximityQuery query_;
  std::shared_ptr<const UnknownSnapshot> held_;  ///< by other readers
  CloudSnapshot placed_;                         ///< the boxes of a snapshot
  std::vector<LinkProximity> results_;
  std::vector<UnknownSpaceAnswer> answers_;
  std::vector<std::optional<Surroundings>> surroundings_;  ///< by link, made when first needed
  double surroundings_distance_ = 0.0;                     ///< [m] that they are made with
  std::size_t next_ = 0;  ///< the link whose share is looked at next
};

}  // namespace ist
