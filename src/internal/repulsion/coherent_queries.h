#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/kept_repulsion.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// The distances and the repulsion of a robot's links, with all that is kept of them from one pose
/// to the next (temporal coherence).
///
/// The first answer with a new cloud takes several times as long as those that follow, because
/// nothing of that cloud is proven yet. Two of these objects keep that out of a control cycle:
/// while one answers with the old cloud, another thread calls warm_up() of the other with the new
/// one; then the two are exchanged. One thread at a time.
class CoherentQueries {
 public:
  /// @param model  not null
  CoherentQueries(const std::shared_ptr<const RobotModel>& model, const QueryConfig& config);
  /// @param repulsion  made with the model's packings: spares the choice of its spheres
  CoherentQueries(std::shared_ptr<const RobotModel> model, const QueryConfig& config,
                  Repulsion repulsion);

  ProximityQuery& query() { return query_; }
  const std::shared_ptr<const RobotModel>& model() const { return model_; }
  const Repulsion& repulsion() const { return repulsion_; }

  /// The repulsion of a link; see KeptRepulsion::update().
  RepulsiveWrench repel(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                        const LinkProximity& proximity, const RepulsionConfig& config,
                        TimePoint end = TimePoint::max()) {
    return blends_[link].update(repulsion_, X_FL, clouds_for(link, clouds), proximity, config, end);
  }
  /// The clouds that hold obstacles for a link; valid until the next call.
  SnapshotSpan clouds_for(std::size_t link, SnapshotSpan clouds);
  /// The next repulsion of each link is computed anew.
  void forget_repulsion();

  /// Answers with new clouds, and keeps what that proves. The arguments are as for
  /// ProximityQuery::run() and Repulsion::wrench().
  /// @param config  its deadline is not used
  /// @param limit   [s] what it may take; > 0. What is not done by then is left to the next answer
  void warm_up(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
               SnapshotSpan clouds, const QueryConfig& config, const RepulsionConfig& repulsion,
               double limit);

  /// Takes a model that differs from the present one in packings alone (see same_geometry()). The
  /// distances keep what was proven; links with another packing forget their repulsion.
  /// @param repulsion  made with these packings
  void set_model(std::shared_ptr<const RobotModel> model, const Repulsion& repulsion);

 private:
  std::shared_ptr<const RobotModel> model_;
  ProximityQuery query_;
  Repulsion repulsion_;
  std::vector<KeptRepulsion> blends_;         ///< by link
  std::vector<LinkProximity> answers_;        ///< of warm_up()
  std::vector<const CloudSnapshot*> clouds_;  ///< of clouds_for()
};

}  // namespace ist
