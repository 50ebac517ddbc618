#include "ros/filter/command_filter.h"
#include "ros/parameters/parameter_reader.h"

namespace ist {

FilterConfig read_filter_config(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* errors,
                                std::vector<std::string>* warnings) {
  FilterConfig config;
  RowConfig& rows = config.rows;
  const std::vector<std::string> types = {"trajectory_msgs/JointTrajectory",
                                          "std_msgs/Float64MultiArray", "sensor_msgs/JointState",
                                          "geometry_msgs/TwistStamped", "geometry_msgs/Twist"};
  const Range time = Range::positive("s", 10.0);
  const Range length = Range::non_negative("m", 10.0);
  const Range speed = Range::non_negative("m/s", 100.0);
  ParameterReader reader(tree);
  reader.read_all({
      {"command_type", Choice{types, [&](std::size_t i) { config.command_type = types[i]; }}},
      {"joints", &config.joints},
      {"tool", &config.tool},
      {"self_proximity", &config.self_proximity},
      {"self_stop_distance", &config.self_stop_distance, length},
      {"command_timeout", &config.command_timeout, time},
      {"proximity_timeout", &config.proximity_timeout, time},
      {"joint_timeout", &config.joint_timeout, time},
      {"horizon", &rows.horizon, time},
      {"margin", &rows.margin, length},
      {"stop_distance", &rows.stop_distance, length},
      {"approach_time", &rows.approach_time, time},
      {"retreat_speed", &rows.retreat_speed, speed},
      {"escape_speed", &rows.escape_speed, speed},
      {"obstacle_speed", &rows.obstacle_speed, speed},
      {"obstacle_age", &rows.age, Range::non_negative("s", 60.0)},
  });
  *warnings = reader.unknown();
  *errors = reader.errors();
  if (config.command_type == "geometry_msgs/Twist" && config.tool.empty()) {
    errors->push_back("~tool is empty: it has to name the link that a geometry_msgs/Twist moves");
  }
  for (std::string& error : config_errors(rows, "~")) errors->push_back(std::move(error));
  return config;
}

}  // namespace ist
