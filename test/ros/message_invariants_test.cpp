#include "ros/output/message_invariants.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "ros/output/message_conversion.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;
using Link = ist_proximity::LinkProximity;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

InvariantInput input() { return {ros::Time(100.0), 1.0, 0.02}; }

/// An answer at a distance along z.
LinkProximity measured(double distance) {
  LinkProximity result;
  result.state = distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  result.distance = distance;
  result.lower_bound = distance - 0.026;
  result.margin = 0.02;
  result.sensor_width = 0.005;
  result.p_FCo = Eigen::Vector3d(1.0, 2.0, 3.0);
  result.direction = Eigen::Vector3d::UnitZ();
  result.p_FCl = result.p_FCo + distance * result.direction;
  result.p_LCl = result.p_FCl;
  return result;
}

/// A message with a link of each state.
ProximityArray message() {
  ProximityArray all;
  all.header.stamp = ros::Time(100.0);
  all.status = ProximityArray::NO_POSE;
  all.status_text = "one of the links has no pose";
  const RepulsiveWrench none{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  LinkProximity clear;
  clear.state = LinkState::kClear;
  clear.distance = kInf;
  clear.lower_bound = 1.0;
  all.sources.resize(1);
  all.sources[0].name = "camera";
  all.links.push_back(unknown_link("unknown"));
  all.links.resize(4);
  assign_link("clear", clear, none, Wrench::zero(), {}, "", &all.links[1]);
  assign_link("near", measured(0.3), none, Wrench::zero(), {}, "camera", &all.links[2]);
  assign_link("contact", measured(-0.1), none, Wrench::unknown(), {}, "camera", &all.links[3]);
  return all;
}

TEST(MessageInvariants, holdForEachState) { EXPECT_EQ(broken_invariant(message(), input()), ""); }

// Every promise is broken on its own, and the text names it.
TEST(MessageInvariants, findEachBreach) {
  enum { kUnknown, kClear, kNear, kContact };
  const auto link = [](int i, const std::function<void(Link*)>& change) {
    return [i, change](ProximityArray* all) { change(&all->links[static_cast<std::size_t>(i)]); };
  };
  const std::vector<std::pair<std::string, std::function<void(ProximityArray*)>>> breaches = {
      {"status_text", [](ProximityArray* m) { m->status = ProximityArray::OK; }},
      {"status_text", [](ProximityArray* m) { m->status_text.clear(); }},
      {"no memory has to be OK", [](ProximityArray* m) { m->sources[0].name = "camera/memory"; }},
      {"no memory has to be OK", [](ProximityArray* m) { m->sources[0].status = m->STALE_CLOUD; }},
      {"UNKNOWN where", [](ProximityArray* m) { m->status = m->NO_CLOUD; }},
      {"future", [](ProximityArray* m) { m->header.stamp = ros::Time(100.02); }},
      {"computation_time", [](ProximityArray* m) { m->computation_time = kNaN; }},
      {"'unknown' in state 0: distance", link(kUnknown, [](Link* l) { l->distance = kInf; })},
      {"lower_bound has to be -inf", link(kUnknown, [](Link* l) { l->lower_bound = 0.0; })},
      {"repulsion and", link(kUnknown, [](Link* l) { l->repulsion.x = 0.0; })},
      {"points", link(kUnknown, [](Link* l) { l->point_on_link.z = 0.0; })},
      {"closing_unknown", link(kUnknown, [](Link* l) { l->closing_unknown = 0; })},
      {"+inf", link(kClear, [](Link* l) { l->distance = 2.0; })},
      {"max_distance", link(kClear, [](Link* l) { l->lower_bound = 0.98; })},
      {"source has to be empty", link(kClear, [](Link* l) { l->source = "camera"; })},
      {"'near' in state 2: distance", link(kNear, [](Link* l) { l->distance = kNaN; })},
      {"sign", link(kNear, [](Link* l) { l->distance = -0.3; })},
      {"sign", link(kContact, [](Link* l) { l->distance = 0.1; })},
      {"have to be NaN",
       link(kClear,
            [](Link* l) { l->interval_model = l->interval_sensor = l->interval_tolerance = 0.0; })},
      {"add up", link(kNear, [](Link* l) { l->interval_sensor = 0.006; })},
      {"must not be negative", link(kNear, [](Link* l) { l->interval_tolerance = -0.001; })},
      {"must not be negative", link(kContact, [](Link* l) { l->interval_model = kNaN; })},
      {"margin", link(kNear, [](Link* l) { l->lower_bound = 0.29; })},
      {"margin", link(kContact, [](Link* l) { l->lower_bound = kNaN; })},
      {"finite", link(kNear, [](Link* l) { l->point_on_link_local.x = kNaN; })},
      {"unit", link(kContact, [](Link* l) { l->direction.z = 0.9; })},
      {"along", link(kNear, [](Link* l) { l->point_on_obstacle.x += 1e-3; })},
      {"source has to be named", link(kNear, [](Link* l) { l->source.clear(); })},
      {"repulsion", link(kNear, [](Link* l) { l->repulsion_torque.y = kNaN; })},
      {"penetration has to be 0", link(kNear, [](Link* l) { l->penetration.force.x = 1.0; })},
      {"known or not", link(kContact, [](Link* l) { l->penetration.force.x = 1.0; })},
      {"time_to_contact", link(kNear, [](Link* l) { l->time_to_contact = -1.0; })},
      {"constants", link(kNear, [](Link* l) { l->state = 9; })},
  };
  for (const auto& [words, change] : breaches) {
    ProximityArray broken = message();
    change(&broken);
    const std::string found = broken_invariant(broken, input());
    EXPECT_NE(found.find(words), std::string::npos) << words << ": '" << found << "'";
  }
}

// One number decides: a summary that says more than the links is found.
TEST(MessageInvariants, SummaryAgreesWithItsLinks) {
  ProximityArray all = message();
  const std::vector<bool> counts = {false, true, true, false};
  const double least = all.links[2].lower_bound;
  EXPECT_EQ(broken_agreement(all, counts, least, 0.5), "");
  EXPECT_EQ(broken_agreement(all, counts, -0.1, 0.0), "");
  EXPECT_EQ(broken_agreement(all, counts, kNaN, 0.0), "");
  EXPECT_NE(broken_agreement(all, counts, kNaN, 0.1), "");
  EXPECT_NE(broken_agreement(all, counts, least + 1e-3, 0.5), "");
  EXPECT_NE(broken_agreement(all, counts, -0.1, 0.1), "");
  EXPECT_NE(broken_agreement(all, counts, least, kNaN), "");
  all.links[1].lower_bound = 0.021;  // CLEAR, and near to what was never seen
  EXPECT_NE(broken_agreement(all, counts, least, 0.5), "");
  EXPECT_EQ(broken_agreement(all, counts, 0.021, 0.0), "");
  EXPECT_NE(broken_agreement(all, {true, true, true, true}, 0.021, 0.0), "");  // one is UNKNOWN
}

}  // namespace
}  // namespace ist
