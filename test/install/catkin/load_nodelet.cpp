// The nodelet is found by its name, and its library loads.
#include <nodelet/nodelet.h>
#include <pluginlib/class_loader.hpp>

#include <cstdio>
#include <exception>

int main() {
  try {
    pluginlib::ClassLoader<nodelet::Nodelet> loader("nodelet", "nodelet::Nodelet");
    const auto one = loader.createUniqueInstance("ist_proximity/Proximity");
    std::printf("%s\n", loader.getClassLibraryPath("ist_proximity/Proximity").c_str());
    return one ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
