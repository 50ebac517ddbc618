#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/publisher.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/self_query.h"
#include "ros/add_ons/add_on.h"
#include "ros/common/stop_signal.h"
#include "ros/cycle/late_joints.h"
#include "ros/link_pairs/link_pair_service.h"
#include "ros/poses/pose_source.h"
#include "ros/status/status.h"

namespace ist {

/// Measures link against link: publishes ~self_proximity at 50 Hz of the wall clock, from a thread
/// of its own, and has ~link_pairs. Pairs are left out when one joint or fixed joints alone connect
/// them, when the SRDF disables them (CollisionRules), and when they are in contact at rest. Its
/// links are the monitored ones, and then the paired ones.
class SelfProximity : public AddOn {
 public:
  explicit SelfProximity(const AddOnContext& node);
  ~SelfProximity() override;

  ist_proximity::ProximityArrayConstPtr self_proximity(const ModelState& model) const override;

 private:
  void run();
  void publish_once();
  void publish_unknown(const std::string& problem,
                       std::optional<ModelState::Phase> phase = std::nullopt);
  void publish(const ist_proximity::ProximityArrayConstPtr& message);
  void take_model();
  std::vector<LinkPair> watched_pairs() const;
  LinkProximity nearest(std::size_t link, std::size_t* other) const;
  void add_link(std::size_t link, const RepulsionConfig& repulsion,
                ist_proximity::ProximityArray* message);
  bool is_finished(std::size_t link) const;
  void measure(const LiveConfig& live);
  void compute_wrenches(const LiveConfig& live, TimePoint end, DeadlineCost* cost);
  Wrench penetration(std::size_t link, const LinkProximity& answer) const;

  AddOnContext node_;
  LinkPairService service_{node_};
  ros::Publisher publisher_;

  StopSignal stop_signal_;
  const std::function<bool()> is_stopped_ = [this] { return stop_signal_.stopped(); };
  mutable std::mutex mutex_;  // guards the next two
  ist_proximity::ProximityArrayConstPtr newest_;
  std::shared_ptr<const ModelState> newest_model_;  ///< of which newest_ tells

  // Used by the thread alone.
  std::shared_ptr<const ModelState> loaded_, model_;  ///< the latter with the paired links
  std::unique_ptr<SelfQuery> query_;                  ///< null without a model or its kinematics
  std::unique_ptr<PoseSource> pose_source_;
  std::vector<ClosingSpeed> speeds_;  ///< by link of the robot
  std::vector<LinkBox> boxes_;        ///< likewise
  std::optional<LateJoints> late_joints_;
  ros::Time last_now_, last_stamp_;
  StampedLinkPoses poses_;
  std::vector<PairProximity> results_;
  std::vector<double> approach_;  ///< [m] by pair: what late joints may have taken off its distance
  double margin_ = 0.0;           ///< [m] in their lower bounds
  std::vector<Wrench> wrenches_;  ///< by pair: the wrench on its first link
  std::thread thread_;
};

}  // namespace ist
