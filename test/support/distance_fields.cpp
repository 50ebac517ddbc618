#include "support/distance_fields.h"

#include "internal/geometry/distance_field.h"

namespace ist::test {

std::shared_ptr<const RobotModel> with_fields(const std::shared_ptr<const RobotModel>& model,
                                              std::size_t coarse) {
  using Detail = DistanceField::Detail;
  const auto robot = std::make_shared<RobotModel>(*model);
  for (std::size_t i = 0; i < robot->links.size(); ++i) {
    const Detail detail = coarse > 0 && i % coarse == 0 ? Detail::kCoarse : Detail::kFine;
    LinkModel& link = robot->links[i];
    link.field = std::make_shared<const DistanceField>(link.solid, detail);
  }
  return robot;
}

}  // namespace ist::test
