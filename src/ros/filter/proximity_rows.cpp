#include "ros/filter/proximity_rows.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "ros/common/eigen_conversion.h"

namespace ist {
namespace {

// The box of a link's geometry; empty where the message states none.
Eigen::AlignedBox3d box_of(const ist_proximity::LinkProximity& message) {
  const Eigen::Vector3d center = to_vector(message.box_center), size = to_vector(message.box_size);
  if (!center.allFinite() || !size.allFinite()) return {};
  return {center - 0.5 * size, center + 0.5 * size};
}

bool is_same_box(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b) {
  return a.min() == b.min() && a.max() == b.max();
}
bool is_same(const LinkBox& a, const LinkBox& b) {
  return a.link == b.link && is_same_box(a.box_L, b.box_L);
}
bool is_same_pair(const LinkPair& a, const LinkPair& b) {
  return a.first == b.first && a.second == b.second;
}

LinkState state_of(std::uint8_t state) {
  return static_cast<LinkState>(std::min(state, static_cast<std::uint8_t>(LinkState::kContact)));
}
double bound_of(double lower_bound) { return std::isnan(lower_bound) ? -kInfinity : lower_bound; }

// [m] The largest of all sources.
double blind_skin(const ist_proximity::ProximityArray& message) {
  double largest = 0.0;
  for (const ist_proximity::SourceStatus& source : message.sources) {
    largest = std::max(largest, source.blind_skin);  // of NaN: the first
  }
  return largest;
}

std::size_t place_of(const std::string& link, const std::vector<LinkBox>& boxes) {
  const auto is_it = [&link](const LinkBox& box) { return box.link == link; };
  return static_cast<std::size_t>(std::find_if(boxes.begin(), boxes.end(), is_it) - boxes.begin());
}

}  // namespace

ProximityRows::ProximityRows(std::shared_ptr<const Kinematics> kinematics)
    : kinematics_(std::move(kinematics)), turns_(kinematics_->joints().size(), 0.0) {
  for (const Kinematics::Joint& joint : kinematics_->joints()) {
    if (joint.type != JointType::kFixed && !joint.has_unstated_pose()) {
      turns_[joint.source] += std::abs(joint.multiplier);
    }
  }
  build({}, {});
}

void ProximityRows::build(const std::vector<LinkBox>& boxes, const std::vector<LinkPair>& pairs) {
  boxes_ = boxes;
  builder_.emplace(boxes, kinematics_, pairs);
}

void ProximityRows::set(const ist_proximity::ProximityArray::ConstPtr& obstacles,
                        const ist_proximity::ProximityArray::ConstPtr& self) {
  obstacles_ = obstacles;
  self_ = self;
  other_geometry_.clear();
  std::vector<LinkBox> boxes;
  std::vector<LinkPair> pairs;
  for (const auto& message : {obstacles, self}) {
    if (!message) continue;
    for (const ist_proximity::LinkProximity& link : message->links) {
      const std::size_t place = place_of(link.link, boxes);
      if (place == boxes.size()) boxes.push_back({link.link, {}});
      Eigen::AlignedBox3d& known_L = boxes[place].box_L;
      const Eigen::AlignedBox3d box_L = box_of(link);
      const bool are_known = !known_L.isEmpty() && !box_L.isEmpty();
      if (are_known && !is_same_box(box_L, known_L)) other_geometry_ = link.link;
      known_L.extend(box_L);
    }
  }
  if (self) {
    for (const ist_proximity::LinkPairProximity& pair : self->pairs) {
      pairs.push_back({place_of(pair.first, boxes), place_of(pair.second, boxes)});
    }
  }
  // An attached object, or a model that has been read again, changes the boxes.
  const auto& present = builder_->pairs();
  if (!std::equal(boxes.begin(), boxes.end(), boxes_.begin(), boxes_.end(), is_same) ||
      !std::equal(pairs.begin(), pairs.end(), present.begin(), present.end(), is_same_pair)) {
    build(boxes, pairs);
  }
}

void ProximityRows::read(const PlacedAnswers& obstacles, const PlacedAnswers& self) {
  const auto& links = obstacles_->links;
  const auto& ignored = obstacles_->ignored_links;
  results_.assign(links.size(), LinkProximity());
  obstacle_speeds_.resize(links.size());
  ignored_.resize(links.size());
  for (std::size_t i = 0; i < links.size(); ++i) {
    LinkProximity& result = results_[i];
    result.state = state_of(links[i].state);
    result.lower_bound = bound_of(links[i].lower_bound);
    result.p_FCl = obstacles.X_RF * to_vector(links[i].point_on_link);
    result.p_FCo = obstacles.X_RF * to_vector(links[i].point_on_obstacle);
    result.direction = obstacles.X_RF.linear() * to_vector(links[i].direction);
    obstacle_speeds_[i] = std::max(0.0, links[i].closing_speed_obstacles);
    ignored_[i] = std::find(ignored.begin(), ignored.end(), links[i].link) != ignored.end();
  }
  pair_results_.assign(builder_->pairs().size(), PairProximity());
  for (std::size_t i = 0; i < pair_results_.size(); ++i) {
    const ist_proximity::LinkPairProximity& pair = self_->pairs[i];
    PairProximity& result = pair_results_[i];
    result.state = state_of(pair.state);
    result.lower_bound = bound_of(pair.lower_bound);
    result.p_FCa = self.X_RF * to_vector(pair.point_on_first);
    result.p_FCb = self.X_RF * to_vector(pair.point_on_second);
    result.direction = self.X_RF.linear() * to_vector(pair.direction);
  }
}

void ProximityRows::add_links() {
  for (std::size_t i = 0; i < results_.size(); ++i) {
    if (!ignored_[i]) builder_->add_link(i, results_[i], obstacle_speeds_[i]);
  }
}

void ProximityRows::place(const std::vector<double>& q, BodyPoses* poses) {
  kinematics_->place_joints(q, &joint_poses_);
  kinematics_->place_bodies(joint_poses_, Eigen::Isometry3d::Identity(), poses);
}

double ProximityRows::motion(std::size_t row, const std::vector<double>& moved) const {
  double way = 0.0, turned = 0.0;
  const auto& joints = builder_->joints();
  for (std::size_t c = 0; c < joints.size(); ++c) {
    const double step = moved[joints[c]];
    const double sweep =
        builder_->rows().sweep(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(c));
    if (!(sweep > 0.0)) continue;
    way += sweep * step;
    turned += turns_[joints[c]] * step;
  }
  return turned < 0.5 ? way / (1.0 - turned) : kInfinity;  // also where a position is not known
}

// Moves a witness on a link along with it, from then to now.
void ProximityRows::move(std::size_t link, Eigen::Vector3d* p_R) const {
  if (link >= boxes_.size()) return;
  const auto body = kinematics_->find_body(boxes_[link].link);
  if (!body || !then_.known[*body] || !now_.known[*body]) return;
  *p_R = now_.X_FB[*body] * (then_.X_FB[*body].inverse() * *p_R);
}

const ConstraintRows& ProximityRows::rows(const PlacedAnswers& obstacles, const PlacedAnswers& self,
                                          const std::vector<double>& q_now, const RowConfig& config,
                                          double self_stop_distance) {
  RowConfig of_obstacles = config;
  of_obstacles.blind_skin = blind_skin(*obstacles.message);
  read(obstacles, self);
  place(q_now, &now_);
  const ConstraintRows& rows = builder_->rows();
  const auto index = [&rows](std::size_t row) {
    return static_cast<std::size_t>(rows.origins[row].index);
  };
  place(obstacles.q, &then_);
  builder_->begin(then_, of_obstacles);
  add_links();
  for (std::size_t row = 0; row < rows.count; ++row) {
    results_[index(row)].lower_bound -= motion(row, obstacles.moved);
  }
  for (std::size_t i = 0; i < results_.size(); ++i) move(i, &results_[i].p_FCl);
  if (!pair_results_.empty()) {
    place(self.q, &then_);
    builder_->begin(then_, config);
    builder_->add_pairs(pair_results_);
    for (std::size_t row = 0; row < rows.count; ++row) {
      pair_results_[index(row)].lower_bound -= motion(row, self.moved);
    }
    for (std::size_t i = 0; i < pair_results_.size(); ++i) {
      move(builder_->pairs()[i].first, &pair_results_[i].p_FCa);
      move(builder_->pairs()[i].second, &pair_results_[i].p_FCb);
    }
  }
  builder_->begin(now_, of_obstacles);
  add_links();
  RowConfig of_pairs = config;
  of_pairs.margin = 0.0;
  of_pairs.stop_distance = self_stop_distance;
  builder_->set_config(of_pairs);
  builder_->add_pairs(pair_results_);
  return rows;
}

RowAnswer ProximityRows::answer(const RowOrigin& origin) const {
  const auto i = static_cast<std::size_t>(origin.index);
  if (origin.is_pair) {
    const ist_proximity::LinkPairProximity& pair = self_->pairs[i];
    return {pair.first, pair.second, pair.lower_bound, pair_results_[i].p_FCa,
            pair_results_[i].p_FCb};
  }
  const ist_proximity::LinkProximity& link = obstacles_->links[i];
  return {link.link, link.source, link.lower_bound, results_[i].p_FCl, results_[i].p_FCo};
}

}  // namespace ist
