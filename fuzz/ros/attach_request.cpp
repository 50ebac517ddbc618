// Requests of ~attach_object become an object with a finite pose and a shape of positive size, or
// an error that says what is wrong. How roscpp reads them from the network is not tested: it takes
// as much memory as a message announces, whatever its size.
//
// Covers: src/ros/services/object_conversion.cpp src/ros/common/eigen_conversion.cpp
// Longest input: 300

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ros/services/object_conversion.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;
using Request = ist_proximity::AttachObject::Request;

Request request_from(ByteReader* in) {
  Request request;
  request.name = in->flag() ? "tool" : in->text(20);
  request.link = "hand";
  request.shape = in->byte() % 5;
  for (std::size_t i = in->below(5); i > 0; --i) request.dimensions.push_back(in->number(1.0));
  const std::uint8_t kind = in->byte();
  if (kind < 60) request.mesh = in->text(80);
  request.pose.position.x = in->number(1.0);
  request.pose.position.y = in->number(1.0);
  request.pose.position.z = in->number(1.0);
  const Eigen::Quaterniond q(in->pose(0.0).linear());
  request.pose.orientation.w = kind % 4 == 0 ? in->number(1.0) : q.w();
  request.pose.orientation.x = q.x();
  request.pose.orientation.y = q.y();
  request.pose.orientation.z = q.z();
  return request;
}

struct Size {
  double operator()(const ist::Box& box) const { return box.size.minCoeff(); }
  double operator()(const ist::Cylinder& c) const { return std::min(c.radius, c.length); }
  double operator()(const ist::Sphere& sphere) const { return sphere.radius; }
  double operator()(const ist::TriangleMesh& mesh) const {
    return static_cast<double>(mesh.triangles.size());
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const Request request = request_from(&in);
  // Files are another target's.
  if (request.mesh.find('/') == 0 || request.mesh.find("file:") == 0) return 0;
  try {
    const ist::AttachedObject object =
        ist::to_object(request, [](const std::string&) { return std::string(); }, {});
    FUZZ_CHECK(!object.name.empty(), "no name");
    FUZZ_CHECK(ist::is_rigid(object.element.X_LE, 1e-3), "the pose is not rigid");
    const double least = std::visit(Size(), object.element.shape);
    FUZZ_CHECK(std::isfinite(least) && least > 0.0, "size %g", least);
  } catch (const ist::ModelError& error) {
    FUZZ_CHECK(error.what()[0] != '\0', "no reason");
  }
  return 0;
}
