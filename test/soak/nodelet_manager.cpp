// A nodelet manager for builds under sanitizers. The manager of the package nodelet is not
// instrumented, and its copies of inline functions (the counts of shared pointers) would be called
// in place of ours: the thread sanitizer would not see them. This program is linked with the ROS
// library before all others, whose copies are called then.

#include <nodelet/loader.h>
#include <ros/ros.h>

int main(int argc, char** argv) {
  ros::init(argc, argv, "manager");
  nodelet::Loader loader;
  ros::spin();
  return 0;
}
