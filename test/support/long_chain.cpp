#include "support/long_chain.h"

namespace ist::test {

std::string long_chain_urdf(int links) {
  static const char* const kMeshes[] = {"upper_arm.stl", "shoulder_fork.stl", "gripper.dae"};
  static constexpr double kMetres[] = {1.0, 0.001, 1.0};  // the fork is drawn in millimetres
  std::string urdf = "<robot name=\"long_chain\">\n";
  for (int i = 0; i < links; ++i) {
    const std::string name = "link" + std::to_string(i);
    const std::string size = std::to_string(0.05 + 0.001 * i);
    std::string shape;
    if (i % 3 == 0) {
      const std::string scale = std::to_string((0.5 + 0.01 * i) * kMetres[i / 3 % 3]);
      shape = std::string("<mesh filename=\"package://ist_proximity/demo/meshes/") +
              kMeshes[i / 3 % 3] + "\" scale=\"" + scale + " " + scale + " " + scale + "\"/>";
    } else if (i % 3 == 1) {
      shape = "<box size=\"" + size + " 0.08 0.2\"/>";
    } else {
      shape = "<cylinder radius=\"" + size + "\" length=\"0.2\"/>";
    }
    urdf += "<link name=\"" + name + "\"><collision><geometry>" + shape +
            "</geometry></collision></link>\n";
    if (i == 0) continue;
    urdf += "<joint name=\"joint" + std::to_string(i) + "\" type=\"revolute\"><parent link=\"link" +
            std::to_string(i - 1) + "\"/><child link=\"" + name +
            "\"/><origin xyz=\"0 0 0.1\"/><axis xyz=\"" + (i % 2 == 0 ? "1 0 0" : "0 1 0") +
            "\"/><limit lower=\"-0.3\" upper=\"0.3\" effort=\"1\" velocity=\"1\"/></joint>\n";
  }
  return urdf + "</robot>\n";
}

}  // namespace ist::test
