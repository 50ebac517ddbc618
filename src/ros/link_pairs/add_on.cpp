#include "ros/add_ons/add_on.h"
#include "ros/link_pairs/link_pair_service.h"
#include "ros/link_pairs/self_proximity.h"

namespace ist {
namespace {

/// Link against link: ~self_proximity and ~link_pairs.
class LinkPairs : public AddOn {
 public:
  explicit LinkPairs(const AddOnContext& node)
      : distances_(node.private_nh, node.config, node.loader, node.buffer, node.joints, node.live),
        service_(node.private_nh, node.config, node.loader) {}

  ist_proximity::ProximityArrayConstPtr self_proximity(const ModelState& model) const override {
    return distances_.newest(model);
  }

 private:
  SelfProximity distances_;
  LinkPairService service_;
};

}  // namespace

std::unique_ptr<AddOn> make_link_pairs(const AddOnContext& node) {
  if (!node.config.self_collision.enabled) return nullptr;
  return std::make_unique<LinkPairs>(node);
}

}  // namespace ist
