// This part of TrajectoryWatch publishes its answers, and what follows from them.

#include <actionlib_msgs/GoalID.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/numbers.h"
#include "ros/common/eigen_conversion.h"
#include "ros/common/publish.h"
#include "ros/common/text.h"
#include "ros/output/markers.h"
#include "ros/trajectory/trajectory_watch.h"

namespace ist {
namespace {

using visualization_msgs::Marker;

// [s] A goal is cancelled so much before braking is due, for the thread and the message, and by the
// time that an answer takes.
constexpr double kAhead = 0.02;
constexpr std::size_t kMaxSpheresPerLink = 50;
constexpr double kLifetime = 0.5;    // [s] of markers
constexpr double kTextHeight = 0.1;  // [m]

}  // namespace

// @param now  [s] of the trajectory
void TrajectoryWatch::fill(const std::vector<LinkClearance>& found, const std::vector<bool>& moved,
                           double now, Message* message) {
  double contact = kInfinity;
  std::size_t first = 0;
  std::string unknown;
  message->lower_bound = kInfinity;
  for (std::size_t i = 0; i < model_->monitored.size(); ++i) {
    const std::size_t link = model_->monitored[i];
    if (!moved[link]) continue;
    const LinkClearance& one = found[link];
    message->links.push_back(model_->links[i]);
    message->lower_bounds.push_back(one.lower_bound);
    if (std::isnan(one.contact_time)) {
      if (unknown.empty()) unknown = model_->links[i];
      continue;
    }
    message->lower_bound = std::min(message->lower_bound, one.lower_bound);
    if (one.contact_time < contact) {
      contact = one.contact_time;
      first = i;
    }
  }
  if (!unknown.empty()) {
    message->lower_bound = kNaN;
    message->state = Message::UNKNOWN;
    message->text = "nothing is known of link '" + unknown + "' on its way" +
                    (here_.status_text.empty() ? "" : ": " + here_.status_text);
  } else if (contact == kInfinity) {
    message->state = Message::CLEAR;
    message->text = format_text("no link comes nearer than %.3f m", message->lower_bound);
  } else {
    fill_contact(first, contact, now, message);
  }
}

// @param link  that touches first, as ~proximity counts
void TrajectoryWatch::fill_contact(std::size_t link, double contact, double now, Message* message) {
  message->state = Message::CONTACT;
  // An obstacle that the robot touches now counts at once, also before it begins to move.
  const bool is_now = contact <= now;
  message->contact = is_now ? message->header.stamp : trajectory_.instant(contact);
  message->time_to_contact = (message->contact - message->header.stamp).toSec();
  message->text = format_text("link '%s' may touch an obstacle in %.2f s",
                              model_->links[link].c_str(), message->time_to_contact);
  if (config_.deceleration.is_stated()) {
    const double way =
        braking_way(trajectory_.pieces, now, contact, config_.deceleration.of(*model_->kinematics));
    message->brake =
        is_now ? message->header.stamp : trajectory_.instant(std::max(now, contact - way));
    message->text +=
        format_text("; braking is due in %.2f s", (message->brake - message->header.stamp).toSec());
  }
  LiveConfig live = node_.live();
  live.query.deadline = 0.0;
  ist_proximity::ProximityArray there;
  const auto state = trajectory_.state(*model_->kinematics, contact);
  if (!stated_.run(state, live, &there).empty() || link >= there.links.size()) return;
  message->first = there.links[link];
  draw(*message);
}

// Draws the robot where it was measured last for rviz, and the time until then as one number. rviz
// drops the markers when they are not renewed for half a second.
void TrajectoryWatch::draw(const Message& message) {
  if (markers_.getNumSubscribers() == 0) return;
  const Kinematics& kinematics = *model_->kinematics;
  BodyPoses bodies;
  stated_.poses().look_up_all(kinematics, message.contact, &bodies);
  visualization_msgs::MarkerArray result;
  const std_msgs::ColorRGBA color = make_color(1.0, 0.35, 0.1, 0.3);
  for (Marker& sphere :
       sphere_markers(*model_->robot, model_->monitored, kMaxSpheresPerLink).markers) {
    const auto body = kinematics.find_body(sphere.ns);
    if (!body || !bodies.known[*body]) continue;
    assign(bodies.X_FB[*body] * to_vector(sphere.pose.position), &sphere.pose.position);
    sphere.ns = "ghost";
    sphere.color = color;
    sphere.frame_locked = false;
    result.markers.push_back(std::move(sphere));
  }
  const auto first = kinematics.find_body(message.first.link);
  Marker text;
  text.ns = "time";
  text.type = Marker::TEXT_VIEW_FACING;
  text.text = format_text("%.2f s", message.time_to_contact);
  text.scale.z = kTextHeight;
  text.color = make_color(1.0, 0.35, 0.1, 1.0);
  text.pose.orientation.w = 1.0;
  if (first && bodies.known[*first]) {
    assign(bodies.X_FB[*first].translation(), &text.pose.position);
    result.markers.push_back(text);
  }
  for (std::size_t k = 0; k < result.markers.size(); ++k) {
    Marker& marker = result.markers[k];
    marker.header = message.header;
    marker.id = static_cast<int>(k);
    marker.lifetime = ros::Duration(kLifetime);
  }
  publish_message(markers_, result);
}

void TrajectoryWatch::publish(Message* message, std::uint8_t state, const std::string& text) {
  message->state = state;
  message->text = text;
  const bool is_known = state == Message::CLEAR || state == Message::CONTACT;
  if (!is_known) message->lower_bound = kNaN;
  if (state != Message::CONTACT) {
    message->time_to_contact = state == Message::CLEAR ? kInfinity : kNaN;
  }
  last_look_ = Clock::now();
  is_unknown_ = state == Message::UNKNOWN;
  // Without a deceleration a contact is told, and nobody knows when braking is due.
  brake_ = state == Message::CONTACT ? message->brake : ros::Time();
  publish_message(publisher_, *message);
  cancel_when_due(message->header.stamp);
}

void TrajectoryWatch::cancel_when_due(const ros::Time& now) {
  if (!cancel_ || !is_watching_) return;
  const bool is_due = !brake_.isZero() && now + ros::Duration(kAhead + took_) >= brake_;
  // The first joint states are still on their way.
  const bool is_starting = Clock::now() - listening_since_ < kStateTimeout;
  if (!is_due && (!is_unknown_ || is_starting)) return;
  is_unknown_ = false;  // told again with the next answer
  brake_ = ros::Time();
  publish_message(cancel_, actionlib_msgs::GoalID());  // an empty one stands for all goals
}

}  // namespace ist
