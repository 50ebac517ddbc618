#include "ist_proximity/control/constraint_rows.h"

#include <algorithm>
#include <cmath>

#include "control/row_config.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {
namespace {

constexpr double kBoxPadding = 1e-6;  // [m] more than rounding of supports and poses
constexpr double kRounding = 1e-9;    // share taken off limits, for the rounding of sums
constexpr double kGrowth = 0.1;       // [m] by which levers may grow within a certified radius
// The share of escape and retreat speed in contact, where the way out may lead into what is not
// seen. At the defaults a millimetre, after which distances prove more, takes a tenth of a second.
constexpr double kContactShare = 0.2;
// The share of the retreat that a row's sweep allows which it asks for at most: others want a part.
constexpr double kRetreatShare = 0.5;

bool moves(const Kinematics::Joint& joint) {
  return joint.type != JointType::kFixed && !joint.has_unstated_pose();
}

// [m/s] The largest rate of approach to the nearest obstacle.
double approach_limit(const RowConfig& config, double bound, double speed) {
  const double stop_distance = config.stop_distance + config.blind_skin;
  const double limit = (bound - speed * config.age - stop_distance) / config.approach_time - speed;
  if (limit >= 0.0) return (1.0 - kRounding) * limit;
  return std::max(-config.retreat_speed, limit);  // of NaN, as with an infinite speed: the first
}

// [m] How far points of a link whose obstacles are `bound` away may move, proven to touch nothing.
double free_motion(const RowConfig& config, double bound) {
  const double margin = config.margin + config.blind_skin;
  if (bound > margin) return (1.0 - kRounding) * (bound - margin);
  if (!(bound > config.blind_skin)) return 0.0;
  return std::min(0.5 * bound, config.escape_speed * config.horizon);
}

}  // namespace

std::vector<LinkBox> link_boxes(const RobotModel& model) {
  std::vector<LinkBox> boxes;
  for (const LinkModel& link : model.links) {
    Eigen::AlignedBox3d box;
    if (link.usable() && !link.solid.empty()) {
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d n = Eigen::Vector3d::Unit(axis);
        box.max()[axis] = support(link.solid, n) + kBoxPadding;
        box.min()[axis] = -support(link.solid, -n) - kBoxPadding;
      }
    }
    boxes.push_back({link.name, box});
  }
  return boxes;
}

ConstraintRowBuilder::ConstraintRowBuilder(const RobotModel& model,
                                           std::shared_ptr<const Kinematics> kinematics,
                                           std::vector<LinkPair> pairs, std::size_t capacity)
    : ConstraintRowBuilder(link_boxes(model), std::move(kinematics), std::move(pairs), capacity) {}

ConstraintRowBuilder::ConstraintRowBuilder(const std::vector<LinkBox>& links,
                                           std::shared_ptr<const Kinematics> kinematics,
                                           std::vector<LinkPair> pairs, std::size_t capacity)
    : kinematics_(std::move(kinematics)), pairs_(std::move(pairs)) {
  const auto& joints = kinematics_->joints();
  column_.resize(joints.size(), 0);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].is_free()) continue;
    column_[j] = static_cast<Eigen::Index>(joints_.size());
    joints_.push_back(j);
  }
  for (const LinkBox& link : links) {
    const auto body = kinematics_->find_body(link.link);
    // The origin is in every box: it is where a link without geometry is.
    Eigen::AlignedBox3d box(Eigen::Vector3d::Zero());
    box.extend(link.box_L);
    Corners corners_B;
    for (std::size_t k = 0; k < corners_B.size(); ++k) {
      corners_B[k] = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
    }
    links_.push_back({body ? *body : kinematics_->bodies().size(), corners_B});
  }
  if (capacity == 0) capacity = 3 * links_.size() + pairs_.size();
  const auto rows = static_cast<Eigen::Index>(capacity);
  const auto columns = static_cast<Eigen::Index>(joints_.size());
  rows_.G.setZero(rows, columns);
  rows_.sweep.setZero(rows, columns);
  rows_.h.setZero(rows);
  rows_.sweep_limit.setZero(rows);
  rows_.radius.setZero(rows);
  rows_.origins.resize(capacity);
  jacobian_.setZero(6, static_cast<Eigen::Index>(joints.size()));
  levers_.setZero(columns);
  unit_levers_.setZero(columns);
}

void ConstraintRowBuilder::begin(const BodyPoses& bodies, const RowConfig& config) {
  const std::size_t count = kinematics_->bodies().size();
  bodies_ = &bodies;
  config_ = config;
  rows_.horizon = config.horizon;
  rows_.count = 0;
  rows_.is_complete =
      bodies.X_FB.size() == count && bodies.known.size() == count && is_usable(config);
}

void ConstraintRowBuilder::set_config(const RowConfig& config) {
  config_ = config;
  if (!is_usable(config) || config.horizon != rows_.horizon) rows_.is_complete = false;
}

void ConstraintRowBuilder::add_links(Span<const LinkProximity> answers,
                                     Span<const double> obstacle_speeds) {
  if (answers.size() != links_.size() ||
      (!obstacle_speeds.empty() && obstacle_speeds.size() != links_.size())) {
    rows_.is_complete = false;
    return;
  }
  for (std::size_t i = 0; i < links_.size(); ++i) {
    add_link(i, answers[i], obstacle_speeds.empty() ? 0.0 : obstacle_speeds[i]);
  }
}

void ConstraintRowBuilder::add_link(std::size_t link, const LinkProximity& answer,
                                    double obstacle_speed) {
  if (link >= links_.size()) rows_.is_complete = false;
  if (!rows_.is_complete) return;
  RowOrigin origin;
  origin.index = static_cast<std::int32_t>(link);
  origin.source = answer.source;
  origin.state = answer.state;
  origin.bound = answer.lower_bound;
  const double speed = std::max(config_.obstacle_speed, obstacle_speed);  // of NaN: the first
  add({origin, links_[link].body, 0, {answer.p_FCl, answer.p_FCo, answer.direction}, speed},
      links_[link], nullptr);
}

void ConstraintRowBuilder::add_pairs(Span<const PairProximity> answers) {
  if (answers.size() != pairs_.size()) rows_.is_complete = false;
  for (std::size_t i = 0; i < pairs_.size() && rows_.is_complete; ++i) {
    const LinkPair& pair = pairs_[i];
    if (pair.first >= links_.size() || pair.second >= links_.size()) {
      rows_.is_complete = false;
      return;
    }
    RowOrigin origin;
    origin.is_pair = true;
    origin.index = static_cast<std::int32_t>(i);
    origin.state = answers[i].state;
    origin.bound = answers[i].lower_bound;
    const Body &first = links_[pair.first], &second = links_[pair.second];
    add({origin,
         first.body,
         second.body,
         {answers[i].p_FCa, answers[i].p_FCb, answers[i].direction},
         0.0},
        first, &second);
  }
}

// The nearest body that both hang on: every body comes after its parent.
std::size_t ConstraintRowBuilder::common_body(std::size_t a, std::size_t b) const {
  while (a != b) {
    std::size_t& later = a > b ? a : b;
    later = kinematics_->joints()[later - 1].parent;
  }
  return a;
}

// Adds by column how far the joints between a body and its ancestor carry points of the body, at
// unit speed: the largest distance from the axis, plus `growth` [m]. Without points: 1 for each
// joint. Returns false where a pose is not known.
bool ConstraintRowBuilder::add_levers(std::size_t body, std::size_t ancestor,
                                      Span<const Eigen::Vector3d> points_F, double growth,
                                      Eigen::VectorXd* levers) const {
  const auto& joints = kinematics_->joints();
  for (std::size_t at = body; at != ancestor; at = joints[at - 1].parent) {
    const Kinematics::Joint& joint = joints[at - 1];
    if (!moves(joint)) continue;
    double lever = 1.0;
    if (!points_F.empty() && joint.type != JointType::kPrismatic) {
      if (!bodies_->known[at]) return false;
      const Eigen::Isometry3d& X_FB = bodies_->X_FB[at];
      const Eigen::Vector3d axis_F = X_FB.linear() * joint.axis;
      lever = growth;
      for (const Eigen::Vector3d& p : points_F) {
        lever = std::max(lever, axis_F.cross(p - X_FB.translation()).norm() + growth);
      }
    }
    (*levers)[column_[joint.source]] += std::abs(joint.multiplier) * lever;
  }
  return true;
}

// Adds the levers of a link to levers_; those are NaN where they are not known.
void ConstraintRowBuilder::add_sweep(const Body& link, std::size_t ancestor, double growth) {
  Corners corners_F;
  for (std::size_t k = 0; k < corners_F.size(); ++k) {
    corners_F[k] = bodies_->X_FB[link.body] * link.corners_B[k];
  }
  const bool is_known =
      bodies_->known[link.body] && add_levers(link.body, ancestor, corners_F, growth, &levers_);
  if (!is_known) levers_.setConstant(std::numeric_limits<double>::quiet_NaN());
}

// Sets a row of G; returns false where the direction or a pose is not known.
bool ConstraintRowBuilder::add_gradient(const Answer& answer, Eigen::Index row) {
  rows_.G.row(row).setZero();
  const Witness& witness = answer.witness;
  const auto add_part = [&](std::size_t body, const Eigen::Vector3d& p_F, double sign) {
    if (body == 0) return;
    point_jacobian(*kinematics_, bodies_->X_FB, body, p_F, &jacobian_);
    for (std::size_t c = 0; c < joints_.size(); ++c) {
      rows_.G(row, static_cast<Eigen::Index>(c)) +=
          sign *
          witness.direction.dot(jacobian_.col(static_cast<Eigen::Index>(joints_[c])).head<3>());
    }
  };
  add_part(answer.a, witness.p_FCa, -1.0);
  if (answer.origin.is_pair) add_part(answer.b, witness.p_FCb, 1.0);
  return rows_.G.row(row).allFinite() && std::abs(witness.direction.norm() - 1.0) < 1e-6;
}

double ConstraintRowBuilder::certified_radius(const Answer& answer, std::size_t ancestor) {
  const Span<const Eigen::Vector3d> obstacle(&answer.witness.p_FCb, 1);
  levers_.setZero();
  if (!add_levers(answer.a, ancestor, obstacle, kGrowth, &levers_)) return 0.0;
  if (answer.origin.is_pair && !add_levers(answer.b, ancestor, obstacle, kGrowth, &levers_)) {
    return 0.0;
  }
  // unit_levers_ holds the factors of the mimic joints; a lever is at most the largest ratio.
  double largest = 1.0;
  for (Eigen::Index c = 0; c < levers_.size(); ++c) {
    if (unit_levers_[c] > 0.0) largest = std::max(largest, levers_[c] / unit_levers_[c]);
  }
  const double curvature = largest * unit_levers_.squaredNorm();
  return std::min(std::sqrt(2.0 * config_.linear_error / curvature), kGrowth / levers_.norm());
}

void ConstraintRowBuilder::add(const Answer& answer, const Body& first, const Body* second) {
  const std::size_t bodies = kinematics_->bodies().size();
  const bool has_bodies = answer.a < bodies && answer.b < bodies;
  const std::size_t ancestor = has_bodies && second ? common_body(answer.a, answer.b) : 0;
  unit_levers_.setZero();
  if (has_bodies) {
    add_levers(answer.a, ancestor, {}, 0.0, &unit_levers_);
    if (second != nullptr) add_levers(answer.b, ancestor, {}, 0.0, &unit_levers_);
    if (unit_levers_.isZero(0.0)) return;
  } else {
    unit_levers_.setOnes();
  }
  if (rows_.count == rows_.origins.size()) {
    rows_.is_complete = false;
    return;
  }
  const auto row = static_cast<Eigen::Index>(rows_.count);
  RowOrigin& origin = rows_.origins[rows_.count++];
  origin = answer.origin;
  rows_.h[row] = kInfinity;
  rows_.radius[row] = rows_.sweep_limit[row] = 0.0;
  rows_.sweep.row(row) = unit_levers_.transpose();
  if (!has_bodies || origin.state == LinkState::kUnknown || !(origin.bound > -kInfinity)) {
    origin.state = LinkState::kUnknown;
    rows_.G.row(row).setZero();
    return;
  }

  const bool has_way = origin.state >= LinkState::kNear && add_gradient(answer, row);
  if (has_way) {
    rows_.h[row] = approach_limit(config_, origin.bound, answer.obstacle_speed);
    rows_.radius[row] = certified_radius(answer, ancestor);
  } else {
    rows_.G.row(row).setZero();
  }
  const double bound = origin.bound - answer.obstacle_speed * (config_.age + config_.horizon);
  double motion = free_motion(config_, bound);
  origin.is_proven = bound > config_.blind_skin || !has_way;
  if (!origin.is_proven) {
    motion = kContactShare * config_.escape_speed * config_.horizon;
    rows_.h[row] = std::min(kContactShare * rows_.h[row], 0.0);  // above 0 by rounding
  }
  levers_.setZero();
  add_sweep(first, ancestor, motion);
  if (second != nullptr) add_sweep(*second, ancestor, motion);
  if (levers_.allFinite()) {
    rows_.sweep.row(row) = levers_.transpose();
    rows_.sweep_limit[row] = motion / config_.horizon;
  }
  if (rows_.h[row] < 0.0) rows_.h[row] = std::max(rows_.h[row], -kRetreatShare * retreat(row));
}

// [m/s] The fastest retreat that the sweep of a row allows: of the joint with the best lever.
double ConstraintRowBuilder::retreat(Eigen::Index row) const {
  double best = 0.0;
  for (Eigen::Index c = 0; c < rows_.G.cols(); ++c) {
    const double lever = rows_.sweep(row, c);
    if (lever > 0.0) best = std::max(best, std::abs(rows_.G(row, c)) / lever);
  }
  return best * std::min(rows_.sweep_limit[row], std::numeric_limits<double>::max());
}

ConstraintRows constraint_rows(const RobotModel& model,
                               const std::shared_ptr<const Kinematics>& kinematics,
                               Span<const double> q, Span<const LinkProximity> answers,
                               const RowConfig& config) {
  ConstraintRowBuilder builder(model, kinematics, {}, answers.size());
  ForwardKinematics forward(model, kinematics);
  std::vector<double> positions(kinematics->joints().size(),
                                std::numeric_limits<double>::quiet_NaN());
  const bool fits = q.size() == builder.joints().size();
  for (std::size_t c = 0; fits && c < q.size(); ++c) {
    if (std::isfinite(q[c])) positions[builder.joints()[c]] = q[c];
  }
  forward.run(positions);
  builder.begin(forward.bodies(), config);
  builder.add_links(answers);
  ConstraintRows rows = builder.rows();
  rows.is_complete = rows.is_complete && fits;
  return rows;
}

}  // namespace ist
