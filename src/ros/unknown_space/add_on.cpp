#include <visualization_msgs/MarkerArray.h>

#include "ros/add_ons/add_on.h"
#include "ros/unknown_space/unknown_space.h"
#include "ros/unknown_space/unknown_space_query.h"

namespace ist {
namespace {

/// Space that no memory knows: a part in every cycle, and ~unseen_space.
class UnknownSpaceAddOn : public AddOn {
 public:
  explicit UnknownSpaceAddOn(AddOnContext node)
      : is_obstacle_(node.config.unknown_space == UnknownSpace::kObstacle),
        watch_(std::make_shared<UnknownSpaceWatch>(
            node.memories, node.config.query.max_distance,
            node.private_nh.advertise<visualization_msgs::MarkerArray>("unseen_space", 1))) {}

  std::unique_ptr<AddOnCycle> make_cycle(const ModelState& model,
                                         CloudSelection::Reader reader) override {
    return std::make_unique<UnknownSpaceQuery>(
        model.robot, watch_, reader == CloudSelection::Reader::kOnly, is_obstacle_);
  }

 private:
  const bool is_obstacle_;
  const std::shared_ptr<UnknownSpaceWatch> watch_;
};

}  // namespace

std::unique_ptr<AddOn> make_unknown_space(const AddOnContext& node) {
  if (node.config.unknown_space == UnknownSpace::kFree) return nullptr;
  return std::make_unique<UnknownSpaceAddOn>(node);
}

}  // namespace ist
