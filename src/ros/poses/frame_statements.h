#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/datatypes.h>
#include <ros/time.h>

#include <Eigen/Core>
#include <array>
#include <boost/weak_ptr.hpp>
#include <string>
#include <utility>
#include <vector>

namespace ist {

/// A node that states transforms.
struct TransformPublisher {
  TransformPublisher(const char* name_of_node) : name(name_of_node) {}  // NOLINT: a name will do
  TransformPublisher(std::string name_of_node,                          // NOLINT: likewise
                     const boost::shared_ptr<ros::M_string>& header = nullptr)
      : name(std::move(name_of_node)), connection(header), has_connection(header != nullptr) {}

  bool is_gone() const { return has_connection && connection.expired(); }

  std::string name;
  /// The header of its connection, which roscpp frees with the connection.
  boost::weak_ptr<ros::M_string> connection;
  bool has_connection = false;  ///< false: it is there for good
};

/// What each publisher says of the pose of one frame, and whether two of them disagree: they name
/// two parents, or places that no motion explains, or, where one of them is static, that are more
/// than rounding apart.
///
/// A place is compared with the line between two places of another publisher about its stamp, so
/// that a motion is no disagreement: it may differ by 0.01 (m, quaternion) and by what an
/// acceleration of 50 (m/s2, rad/s2) explains. While a publisher's places stay, older ones of
/// others are compared with them too, so that two clocks hide no disagreement.
///
/// What a publisher says last counts, so that a correction is no dispute. A dispute ends when they
/// agree, when the one has been silent for a second, or for three of its periods if that is longer,
/// and with the connection of a static publisher. Not thread safe.
class FrameStatements {
 public:
  /// Adds what a publisher says, and decides anew.
  /// @param now  the ROS clock's time
  void add(const geometry_msgs::TransformStamped& transform, const TransformPublisher& publisher,
           bool is_static, const ros::Time& now);
  /// Forgets a publisher, but for the dispute, which decide() ends.
  void withdraw(const std::string& publisher);
  /// Forgets all that is not static after a jump of the clock, but for the dispute.
  void forget_moving();
  /// Forgets publishers that say nothing any more, and finds the first two that disagree.
  void decide(const ros::Time& now);

  bool empty() const { return statements_.empty(); }
  /// The sentence on two that disagree, with their names, and since when; empty: there are none.
  const std::string& dispute() const { return dispute_; }
  /// The static transforms that are stated.
  std::vector<geometry_msgs::TransformStamped> statics() const;

 private:
  /// Translation [m] and quaternion.
  using Place = Eigen::Matrix<double, 7, 1>;
  struct Sample {
    ros::Time stamp;  ///< 0: none yet
    Place place;
  };
  /// What a publisher said last.
  struct Statement {
    explicit Statement(TransformPublisher who) : publisher(std::move(who)) {}

    TransformPublisher publisher;
    bool is_static = false;
    geometry_msgs::TransformStamped transform;
    ros::Time received;
    double silence = 0.0;           ///< [s] after which a moving one says nothing any more
    std::array<Sample, 2> samples;  ///< of a moving one, the newest first
    Sample stays;                   ///< the first of those from which no later one differs
    double longest = 0.0;           ///< [s] between two samples since then
    std::string rival;              ///< whose motion is another, until
    ros::Time rival_until;
  };

  static Place place_of(const geometry_msgs::Transform& transform);
  static bool differs(const Place& place, const Place& other, double slack);
  static bool disagrees(const Statement& mine, const Sample& sample);
  void note_motion(const Sample& sample, const ros::Time& now, Statement* own) const;
  static std::string why_disagreeing(const Statement& a, const Statement& b, const ros::Time& now);

  std::vector<Statement> statements_;  ///< by publisher, in the order of their first ones
  std::string dispute_;
};

}  // namespace ist
