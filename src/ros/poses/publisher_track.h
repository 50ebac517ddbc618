#pragma once

#include <ros/time.h>

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace ist {

/// Notices that two publishers state different values of the same thing: a joint's position, a
/// transform. Not thread safe.
///
/// A value is compared with the line between the two values of another publisher about it, so that
/// a motion is no disagreement: it may differ by 0.01 (m, rad) and by what an acceleration of 50
/// (m/s2, rad/s2) explains. While a publisher's values stay, older ones of others are compared with
/// them too, so that two clocks hide no disagreement. One publisher that takes over from another
/// agrees with it in this sense.
class PublisherTrack {
 public:
  /// A position [rad, m]; or translation [m] and quaternion of a transform.
  using Values = Eigen::Matrix<double, 7, 1>;

  /// Adds a sample.
  /// @param publisher  name of its node
  /// @param other      receives the name of the publisher that it disagrees with
  /// @param value      receives the other publisher's values
  /// @returns whether it disagrees with another publisher
  bool add(const std::string& publisher, const ros::Time& stamp, const Values& values,
           std::string* other, Values* other_values);

 private:
  struct Sample {
    ros::Time stamp;
    Values values;
  };
  struct Publisher {
    std::string name;
    std::array<Sample, 2> samples;  ///< the newest first; stamp 0: none yet
    Sample stays;                   ///< the first of those from which no later one differs
    double longest = 0.0;           ///< [s] between two samples since then
  };

  static bool disagrees(const Publisher& mine, const Sample& sample);

  std::vector<Publisher> publishers_;
};

}  // namespace ist
