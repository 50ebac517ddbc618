#include "ros/add_ons/add_on.h"

#include <utility>

namespace ist {

std::vector<std::unique_ptr<AddOnCycle>> make_cycles(const AddOns& add_ons, const ModelState& model,
                                                     CloudSelection::Reader reader) {
  std::vector<std::unique_ptr<AddOnCycle>> cycles;
  for (const std::unique_ptr<AddOn>& add_on : add_ons) {
    std::unique_ptr<AddOnCycle> cycle = add_on->make_cycle(model, reader);
    if (cycle) cycles.push_back(std::move(cycle));
  }
  return cycles;
}

}  // namespace ist
