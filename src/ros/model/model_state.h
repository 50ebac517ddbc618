#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "internal/robot/anytime_model.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/model/link_choice.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// The links that something has come near, which need final packings and contact volumes. The cycle
/// writes it, background threads read it, and neither waits.
class LinkUsage {
 public:
  explicit LinkUsage(std::size_t links) : was_near_(links) {}

  /// Notes that something is within the influence distance of a link.
  void note_near(std::size_t link) { was_near_[link].store(true, std::memory_order_relaxed); }

  /// Whether something has been within the influence distance at any time.
  bool was_near(std::size_t link) const { return was_near_[link].load(std::memory_order_relaxed); }

  std::size_t size() const { return was_near_.size(); }

 private:
  std::vector<std::atomic<bool>> was_near_;
};

/// The robot's model, or how far its loading is. Immutable once it is shared.
struct ModelState {
  enum class Phase {
    kWaiting,  ///< robot_description is not set
    kFailed,   ///< robot_description is set and holds no URDF
    kReading,  ///< robot_description is set, and its meshes are being read
    kPacking,
    kReady,
  };
  Phase phase = Phase::kWaiting;
  std::string problem;                ///< a sentence that says what to do; empty when ready
  double fraction = 0.0;              ///< 0 to 1 while packing
  std::string root_link;              ///< empty until the URDF is known
  std::vector<std::string> links;     ///< monitored, in URDF order; known from kPacking on
  std::vector<std::string> warnings;  ///< given by packing
  /// Known from kPacking on.
  /// Of the SRDF; not null. States share them: there may be a million pairs.
  std::shared_ptr<const CollisionRules> rules = std::make_shared<const CollisionRules>();
  LinkChoice choice;
  /// Known when ready, and while packing with links that are pending. It holds the links that are
  /// monitored, and others that self-filters and link pairs need.
  std::shared_ptr<const RobotModel> robot;
  /// Known with `robot`: where that comes from, and what finer packings are made of.
  AnytimeModel::Ptr anytime;
  /// Repulsion of `robot`; null: the cycle makes its own. Finer packings bring it along.
  std::shared_ptr<const Repulsion> repulsion;
  /// Known with `robot`; states of one robot share it.
  std::shared_ptr<LinkUsage> usage;
  std::vector<std::size_t> monitored;  ///< known with `robot`: indices into robot->links
  std::vector<bool> filters;           ///< known with `robot`, by link: whether self-filters use it
  std::vector<std::size_t> paired;     ///< the same of LinkChoice::paired
  std::shared_ptr<const Kinematics>
      kinematics;                  ///< known from kPacking on; null where it is faulty
  std::string kinematics_problem;  ///< why `kinematics` is null
  std::string rules_problem;       ///< why no pairs of links can be chosen; empty: they can
  std::shared_ptr<const RobotDescription> description;  ///< the parsed URDF; known from kPacking on
  std::vector<AttachedObject> objects;                  ///< known when ready: parts of `robot`

  /// Whether the model is being made: nothing is wrong, and nobody has to do anything but wait.
  bool is_loading() const { return phase == Phase::kReading || phase == Phase::kPacking; }
  bool is_ready() const { return phase == Phase::kReady; }
};

/// Whether the second state is ready and differs from the first one in its packings alone.
bool is_refinement(const ModelState& before, const ModelState& after);

/// The sentence about a URDF whose kinematics is faulty.
std::string no_kinematics(const ModelState& model);

/// The frame F of all results: ~fixed_frame, or else the root link.
std::string fixed_frame_of(const ModelState& model, const ServerConfig& config);

/// Names by link of the robot.
std::vector<std::string> link_names(const RobotModel& robot);

/// The sentence about the first name that is none of the monitored links; empty: all are.
std::string unmonitored_name(const std::vector<std::string>& names, const ModelState& model);

/// By link of model.robot: true for monitored links with usable geometry, whose poses are needed.
std::vector<bool> wanted_links(const ModelState& model);

/// The state with the links of ~self_proximity for monitored ones: after those, the paired ones.
/// @param model  not null; itself the result where nothing is paired
std::shared_ptr<const ModelState> with_paired(std::shared_ptr<const ModelState> model);

/// Chooses the monitored links, in the order in which the model has them.
/// @param wanted  empty: every link with geometry. Names that the URDF lacks go to the end
std::vector<std::string> monitored_links(const RobotDescription& description,
                                         const std::vector<std::string>& wanted);

/// Counts the links of a model that is ready: those that are answered, those whose geometry cannot
/// be read, and those that only the self-filter needs.
std::string link_counts(const ModelState& state);

}  // namespace ist
