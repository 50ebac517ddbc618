#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How velocities are bounded by distances; see ConstraintRows.
struct RowConfig {
  /// [s] > 0: T, from the instant of the poses until another velocity takes the place of this one.
  double horizon = 0.02;
  double margin = 0.01;         ///< [m] >= 0: what is proven to be left
  double stop_distance = 0.05;  ///< [m] >= margin: nearer than this, no witness is approached
  double approach_time = 0.2;   ///< [s] >= horizon, in which what is left of a distance may be used
  /// [m/s] >= 0: the most that a link within the stop distance is asked to retreat; in contact a
  /// fifth of it. 0: it may retreat, and need not.
  double retreat_speed = 0.0;
  /// [m/s] >= 0: how fast points of a link may move that is nearer than the margin; a fifth of it
  /// on the way out of contact, which no bound proves to be free.
  double escape_speed = 0.05;
  double obstacle_speed = 0.0;  ///< [m/s] >= 0: obstacles may come at least this fast
  /// [s] >= 0: age of the obstacles' measurement at the poses' instant, or how long they may have
  /// moved unseen.
  double age = 0.0;
  /// [m] >= 0: obstacles nearer than this need not be in the answers, as within the padding of a
  /// self-filter. It is added to margin and stop_distance.
  double blind_skin = 0.0;
  double linear_error = 0.001;  ///< [m] > 0 that ConstraintRows::radius leaves
};

/// Lists what is wrong with a configuration: one sentence each, with the parameter's name, its
/// value and what is allowed. Empty: it can be used.
/// @param prefix  before each name, such as "~filter/"
std::vector<std::string> config_errors(const RowConfig& config, const std::string& prefix = "");

/// The distance that a row comes from.
struct RowOrigin {
  bool is_pair = false;      ///< a pair of links; false: a link and an obstacle
  std::int32_t index = 0;    ///< of the link in the model, or of the pair in the builder's pairs
  std::int32_t source = -1;  ///< LinkProximity::source; -1: none
  LinkState state = LinkState::kUnknown;                    ///< of the answer, where it can be used
  double bound = -std::numeric_limits<double>::infinity();  ///< [m] the answer's lower_bound
  /// Whether a velocity that meets the row is proven not to touch. False in contact alone.
  bool is_proven = true;
};

/// Linear bounds of joint velocities dq [rad/s, m/s], one row for each answer that joints can
/// change. A velocity meets row i when
///     G.row(i) * dq <= h[i]    and    sweep.row(i) * |dq| <= sweep_limit[i],
/// with |dq| by component. In a linear program or QP the second one is sweep * u <= sweep_limit,
/// -u <= dq <= u, with variables u that all rows share.
///
/// G = -n^T J, with n the unit vector from obstacle to link and J the Jacobian of the closest point
/// on the link (of a pair: of the first link's less that of the second's); so G * dq is the rate at
/// which the nearest obstacle is approached, and -G the gradient of the distance by q. h rests on
/// lower_bound: what it leaves above the stop distance per approach_time, less the obstacles'
/// speed. Within the stop distance h is not above 0: no approach, and retreat is free. Below 0 it
/// asks for a retreat, of no more than half of what `sweep` allows.
///
/// Theorem. Joints move at a constant velocity that meets `sweep` for the time T = horizon, and
/// obstacles move no faster than their speed v. With b = lower_bound - v (age + T), the distance of
/// the link to every obstacle that the answer is about, nearest or not, remains >= m where b > m,
/// and >= b / 2 where blind_skin < b <= m, with m = margin + blind_skin.
/// Proof. sweep_limit T is D = b - m or at most b / 2, and sweep[k] is r_k + D, with r_k the
/// largest distance of the link's box from the axis of joint k (1 for a sliding joint). The
/// distance of the link's points from the axis of joint k changes by what the joints between k and
/// the link move them, so it stays below r_k + D as long as those joints have moved them by less
/// than D; from the last joint to the first this follows from the row. So no point of the link
/// moves farther than sum_k sweep[k] |dq_k| T <= D, and obstacles come nearer by v (age + T) at
/// most. For a pair both links' motions in their nearest common body are in the sum.
///
/// In contact (b <= blind_skin) nothing can be proven: sweep lets points move at a fifth of
/// escape_speed, and G leaves the way out only. Where the way is not known, or the link is UNKNOWN,
/// sweep_limit is 0, and every joint that moves the link must stand.
///
/// Certified linearisation: let s(q) be the distance of the witness on the obstacle from the plane
/// with normal n through the witness on the link, fixed to that link. For |step|_2 <= radius[i],
///     |s(q + step) - (distance - G.row(i) * step)| <= linear_error,
/// since s differs from its linearisation by less than L |step|^2 / 2: a second derivative by two
/// joints is at most the obstacle point's distance from the axis of one of them. A convex link is
/// never nearer to that obstacle point than s.
struct ConstraintRows {
  /// One row for each bound, and one column for each joint of ConstraintRowBuilder::joints().
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  double horizon = 0.0;            ///< [s] RowConfig::horizon
  std::size_t count = 0;           ///< rows in use; the arrays may hold more
  Matrix G;                        ///< [m/rad, 1]; 0 where there is no nearest obstacle
  Eigen::VectorXd h;               ///< [m/s]; +inf where there is no nearest obstacle
  Matrix sweep;                    ///< [m/rad, 1] >= 0
  Eigen::VectorXd sweep_limit;     ///< [m/s] >= 0
  Eigen::VectorXd radius;          ///< [rad, m] see above; 0 where there is no nearest obstacle
  std::vector<RowOrigin> origins;  ///< where each row comes from
  /// False: the configuration cannot be used, poses or answers were of another size than the
  /// robot's, or there were too many. Nothing is proven then.
  bool is_complete = false;
};

/// A box about all of a link's geometry, attached objects included.
struct LinkBox {
  std::string link;           ///< name in the URDF
  Eigen::AlignedBox3d box_L;  ///< [m] in the link's frame; empty: the link's origin alone
};

/// The boxes of all links, in the model's order.
std::vector<LinkBox> link_boxes(const RobotModel& model);

/// Makes ConstraintRows from the answers of one instant. Links that joints cannot move have no row.
/// Floating and planar joints count as standing still, and so do objects that the robot carries:
/// these want a speed. It allocates nothing after construction, locks nothing and never throws. One
/// object per thread.
class ConstraintRowBuilder {
 public:
  /// @param model       read by the constructor only
  /// @param kinematics  of the description that the model was built from; not null
  /// @param pairs       of SelfQuery::pairs(); may be empty
  /// @param capacity    rows at most; 0: three for each link and one for each pair
  ConstraintRowBuilder(const RobotModel& model, std::shared_ptr<const Kinematics> kinematics,
                       std::vector<LinkPair> pairs = {}, std::size_t capacity = 0);
  /// The same for links of which no more than a box is known, such as those of a message.
  ConstraintRowBuilder(const std::vector<LinkBox>& links,
                       std::shared_ptr<const Kinematics> kinematics,
                       std::vector<LinkPair> pairs = {}, std::size_t capacity = 0);

  /// Starts anew.
  /// @param bodies  ForwardKinematics::bodies(), at the instant of the answers; must outlive the
  ///                calls of add_links() and add_pairs()
  void begin(const BodyPoses& bodies, const RowConfig& config);
  /// Bounds what is added from here on in another way, such as pairs; the horizon is begin()'s.
  void set_config(const RowConfig& config);
  /// Adds the answers of a ProximityQuery or of a WorldQuery. May be called for several.
  /// @param answers          by link of the model
  /// @param obstacle_speeds  [m/s] by link, such as ClosingRates::obstacles; raises the
  ///                         configuration's. Empty, or NaN: the configuration's holds
  void add_links(Span<const LinkProximity> answers, Span<const double> obstacle_speeds = {});
  /// Adds one answer of a link: one of WorldQuery::near_objects(), for example.
  void add_link(std::size_t link, const LinkProximity& answer, double obstacle_speed = 0.0);
  /// @param answers  by pair
  void add_pairs(Span<const PairProximity> answers);

  /// Valid until the next begin().
  const ConstraintRows& rows() const { return rows_; }
  /// By column: index of the joint in the kinematics. These are the joints with a position of their
  /// own, in order, as in Robot::joints().
  const std::vector<std::size_t>& joints() const { return joints_; }
  const std::vector<LinkPair>& pairs() const { return pairs_; }  ///< given to the constructor

 private:
  using Corners = std::array<Eigen::Vector3d, 8>;
  struct Body {
    std::size_t body;   // of the kinematics; none: the number of bodies
    Corners corners_B;  // [m] of a box about the link's geometry
  };
  struct Witness {
    Eigen::Vector3d p_FCa, p_FCb, direction;
  };
  struct Answer {
    RowOrigin origin;
    std::size_t a, b;  // bodies; b is the root for an obstacle
    Witness witness;
    double obstacle_speed;
  };

  std::size_t common_body(std::size_t a, std::size_t b) const;
  bool add_levers(std::size_t body, std::size_t ancestor, Span<const Eigen::Vector3d> points_F,
                  double growth, Eigen::VectorXd* levers) const;
  void add_sweep(const Body& link, std::size_t ancestor, double growth);
  bool add_gradient(const Answer& answer, Eigen::Index row);
  double certified_radius(const Answer& answer, std::size_t ancestor);
  double retreat(Eigen::Index row) const;
  void add(const Answer& answer, const Body& first, const Body* second);

  std::shared_ptr<const Kinematics> kinematics_;
  std::vector<LinkPair> pairs_;
  std::vector<Body> links_;
  std::vector<std::size_t> joints_;
  std::vector<Eigen::Index> column_;  // by joint of the kinematics
  const BodyPoses* bodies_ = nullptr;
  RowConfig config_;
  ConstraintRows rows_;
  // Buffers.
  Jacobian jacobian_;
  Eigen::VectorXd levers_, unit_levers_;
};

/// The rows of one configuration, for a robot among obstacles. Allocates; ConstraintRowBuilder is
/// for loops.
/// @param kinematics  of the description that the model was built from; not null
/// @param q        [rad, m] by joint with a position of its own, as in Robot::joints(), NaN where
/// it
///                 is not known. Of another size: the rows are not complete
/// @param answers  by link of the model, at q, with the root link's frame as the fixed frame
ConstraintRows constraint_rows(const RobotModel& model,
                               const std::shared_ptr<const Kinematics>& kinematics,
                               Span<const double> q, Span<const LinkProximity> answers,
                               const RowConfig& config = {});

}  // namespace ist
