#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/time.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ros/cycle/add_on_cycle.h"
#include "ros/cycle/cloud_selection.h"
#include "ros/input/source_memory.h"
#include "ros/model/model_loader.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// A part that the node can be built without (IST_PROXIMITY_ADD_ONS). The rest of the node knows it
/// by this alone.
class AddOn {
 public:
  virtual ~AddOn() = default;

  /// Makes its part in the cycles of a model; null: it has none. Thread safe.
  /// @param reader  the kind of cycle, see CloudSelection
  virtual std::unique_ptr<AddOnCycle> make_cycle(const ModelState& /*model*/,
                                                 CloudSelection::Reader /*reader*/) {
    return nullptr;
  }

  /// Begins to receive what is answered slowly, by a queue whose thread ends before the add-on.
  virtual void subscribe(ros::CallbackQueue* /*queue*/) {}
  /// Goes on where something is due. That thread calls it 20 times a second or more often.
  virtual void run_when_due() {}

  /// The newest distances of link against link; null: none of this model. Thread safe.
  virtual ist_proximity::ProximityArrayConstPtr self_proximity(const ModelState& /*model*/) const {
    return nullptr;
  }
};

using AddOns = std::vector<std::unique_ptr<AddOn>>;

/// The parts of the node that add-ons work with. They outlive all add-ons.
struct AddOnContext {
  ros::NodeHandle nh, private_nh;
  const ServerConfig& config;
  const ModelLoader& loader;
  const CloudSources& sources;
  const SourceMemories& memories;
  const TransformBuffer& buffer;
  JointStateListener* joints;        ///< null with pose_source tf
  const AddOns& add_ons;             ///< all of them
  std::function<LiveConfig()> live;  ///< gives the present configuration; thread safe
  /// The links that ~ignore_links leaves out now, by name; thread safe.
  std::function<std::vector<std::string>(const ros::Time&)> ignored_links;
};

/// Adds the add-ons that the node is built with and that its configuration asks for.
void make_add_ons(const AddOnContext& context, AddOns* add_ons);

/// The parts of all add-ons in the cycles of a model.
std::vector<std::unique_ptr<AddOnCycle>> make_cycles(const AddOns& add_ons, const ModelState& model,
                                                     CloudSelection::Reader reader);

}  // namespace ist
