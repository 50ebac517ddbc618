# The interface for other ROS packages: dependencies, messages and exports.

find_package(catkin REQUIRED COMPONENTS
  actionlib_msgs
  diagnostic_msgs
  dynamic_reconfigure
  geometry_msgs
  message_generation
  nodelet
  pluginlib
  roscpp
  rosgraph_msgs
  sensor_msgs
  std_msgs
  std_srvs
  tf2
  tf2_eigen
  tf2_msgs
  tf2_ros
  topic_tools
  trajectory_msgs
  visualization_msgs)

add_message_files(DIRECTORY msg FILES
  FilterState.msg
  JointRepulsion.msg
  LinkPair.msg
  LinkPairProximity.msg
  LinkProximity.msg
  ProximityArray.msg
  SourceStatus.msg
  SpeedScaleState.msg
  TrajectoryClearance.msg
  WorldObject.msg
  WorldObjects.msg
  WorldOctomap.msg)
add_service_files(DIRECTORY srv FILES
  AttachObject.srv
  DetachObject.srv
  IgnoreLinks.srv
  ListLinkPairs.srv
  QueryProximity.srv
  RemoveZone.srv
  SetZone.srv)
generate_messages(DEPENDENCIES geometry_msgs sensor_msgs std_msgs)

catkin_package(
  INCLUDE_DIRS include
  LIBRARIES ist_proximity_core ist_proximity_ros
  CATKIN_DEPENDS
    actionlib_msgs
    diagnostic_msgs
    dynamic_reconfigure
    geometry_msgs
    message_runtime
    nodelet
    roscpp
    rosgraph_msgs
    sensor_msgs
    std_msgs
    std_srvs
    tf2
    tf2_msgs
    tf2_ros
    topic_tools
    trajectory_msgs
    visualization_msgs
  DEPENDS EIGEN3)
