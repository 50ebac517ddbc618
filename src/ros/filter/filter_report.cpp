// An answer of CommandFilter as a message and as markers.

#include <algorithm>
#include <cmath>
#include <set>

#include "ros/common/eigen_conversion.h"
#include "ros/common/publish.h"
#include "ros/common/text.h"
#include "ros/filter/command_filter.h"
#include "ros/output/markers.h"

namespace ist {
namespace {

using ist_proximity::FilterState;
using visualization_msgs::Marker;

constexpr double kShown = 0.5;  // [s] after which markers of a filter that is gone go
constexpr double kFar = 0.3;    // [m] distance that is drawn green
constexpr double kLineWidth = 0.012, kTextHeight = 0.04;  // [m]

std::string text_of(const RowAnswer& answer, const RowOrigin& origin) {
  if (origin.state == LinkState::kUnknown) {
    return "what is near '" + answer.link + "' is not known";
  }
  return format_text("'%s' is %.3f m from '%s' at least", answer.link.c_str(), answer.bound,
                     answer.source.c_str());
}

}  // namespace

void CommandFilter::explain(const FilterAnswer& answer, FilterState* state) const {
  state->status = static_cast<std::uint8_t>(answer.status);
  state->ignored_links = obstacles_.message->ignored_links;
  std::vector<std::string> texts;
  if (answer.reason != FilterReason::kNone) texts.emplace_back(sentence(answer.reason));
  for (const std::size_t row : answer.rows) {
    const RowAnswer held = proximity_->answer(rows_.origins[row]);
    const std::string text = text_of(held, rows_.origins[row]);
    if (std::find(texts.begin(), texts.end(), text) != texts.end()) continue;
    state->links.push_back(held.link);
    state->sources.push_back(held.source);
    state->bounds.push_back(held.bound);
    texts.push_back(text);
  }
  for (const std::size_t column : answer.joints) {
    const std::string& name = kinematics_->joints()[proximity_->joints()[column]].name;
    auto& joints = state->limited_joints;
    if (std::find(joints.begin(), joints.end(), name) != joints.end()) continue;
    joints.push_back(name);
    texts.push_back("joint '" + name + "' is at a limit");
  }
  state->status_text = join(texts, "; ");
}

/// Draws a line and a text for each row that binds, and deletes what was drawn before. A link
/// whose surroundings are not known has its text at its own frame.
void CommandFilter::draw(const FilterAnswer& answer, const std_msgs::Header& header) const {
  visualization_msgs::MarkerArray array;
  Marker marker;
  marker.header = header;
  marker.action = Marker::DELETEALL;
  array.markers.push_back(marker);
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.lifetime = ros::Duration(kShown);
  for (const std::size_t row : std::set<std::size_t>(answer.rows.begin(), answer.rows.end())) {
    const RowOrigin& origin = rows_.origins[row];
    const RowAnswer held = proximity_->answer(origin);
    const bool has_line = held.p_Rl.allFinite() && held.p_Ro.allFinite();
    marker.ns = "filter";
    marker.id = static_cast<int>(array.markers.size());
    marker.color =
        nearness_color(origin.state == LinkState::kUnknown ? std::nan("") : held.bound, kFar);
    marker.type = Marker::LINE_LIST;
    marker.scale.x = kLineWidth;
    marker.points.resize(2);
    assign(held.p_Ro, &marker.points[0]);
    assign(held.p_Rl, &marker.points[1]);
    if (has_line) array.markers.push_back(marker);
    marker.points.clear();
    ++marker.id;
    marker.type = Marker::TEXT_VIEW_FACING;
    marker.scale.x = 0.0;
    marker.scale.z = kTextHeight;
    marker.text = text_of(held, origin);
    Marker text = marker;
    if (has_line) {
      assign(held.p_Rl, &text.pose.position);
    } else {
      text.header.frame_id = held.link;
      text.header.stamp = ros::Time();  // the newest transform
    }
    array.markers.push_back(text);
  }
  publish_message(markers_, array);
}

}  // namespace ist
