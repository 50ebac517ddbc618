#include <embree3/rtcore.h>

#include <limits>

#include "peers/image_pyramid.h"

// Embree's point query: the nearest triangle of a link's mesh, for groups of points and those
// points that a group's bound does not prune.
namespace ist::benchmark {
namespace {

// Closest point on a triangle (Ericson, Real-Time Collision Detection, section 5.1.5), in float as
// in Embree's own example.
Eigen::Vector3f closest_on_triangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a,
                                    const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0F && d2 <= 0.0F) return a;
  const Eigen::Vector3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0F && d4 <= d3) return b;
  const Eigen::Vector3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0F && d5 <= d6) return c;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0F && d1 >= 0.0F && d3 <= 0.0F) return a + d1 / (d1 - d3) * ab;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0F && d2 >= 0.0F && d6 <= 0.0F) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0.0F && d4 - d3 >= 0.0F && d5 - d6 >= 0.0F) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const float scale = 1.0F / (va + vb + vc);
  return a + vb * scale * ab + vc * scale * ac;
}

struct Surface {
  std::vector<Eigen::Vector3f> corners;  // three for each triangle
  RTCScene scene = nullptr;
};

struct Found {
  const Surface* surface;
  Eigen::Vector3f point;
  bool any = false;
};

bool visit(RTCPointQueryFunctionArguments* arguments) {
  auto& found = *static_cast<Found*>(arguments->userPtr);
  const Eigen::Vector3f* corner = &found.surface->corners[3 * std::size_t{arguments->primID}];
  const Eigen::Vector3f p(arguments->query->x, arguments->query->y, arguments->query->z);
  const Eigen::Vector3f q = closest_on_triangle(p, corner[0], corner[1], corner[2]);
  const float distance = (q - p).norm();
  if (!(distance < arguments->query->radius)) return false;
  arguments->query->radius = distance;
  found.point = q;
  found.any = true;
  return true;
}

// The meshes of a robot in Embree's hierarchies.
class Surfaces {
 public:
  explicit Surfaces(const Robot& robot) : device_(rtcNewDevice("threads=1")) {
    for (const TriangleMesh& mesh : robot.meshes) {
      Surface surface;
      surface.scene = rtcNewScene(device_);
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* vertices = static_cast<float*>(
          rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                  3 * sizeof(float), mesh.vertices.size()));
      for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
          vertices[3 * i + k] = static_cast<float>(mesh.vertices[i][static_cast<int>(k)]);
        }
      }
      auto* indices = static_cast<unsigned*>(
          rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                  3 * sizeof(unsigned), mesh.triangles.size()));
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
          indices[3 * t + k] = mesh.triangles[t][k];
          surface.corners.emplace_back(mesh.corner(t, static_cast<int>(k)).cast<float>());
        }
      }
      rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(surface.scene, geometry);
      rtcReleaseGeometry(geometry);
      rtcSetSceneBuildQuality(surface.scene, RTC_BUILD_QUALITY_HIGH);
      rtcCommitScene(surface.scene);
      surfaces_.push_back(std::move(surface));
    }
  }
  ~Surfaces() {
    for (const Surface& surface : surfaces_) rtcReleaseScene(surface.scene);
    rtcReleaseDevice(device_);
  }
  Surfaces(const Surfaces&) = delete;
  Surfaces& operator=(const Surfaces&) = delete;

  // The surface point nearest to p_L. Returns its distance where it is below `bound`, else `bound`.
  float closest(std::size_t link, const Eigen::Vector3f& p_L, float bound,
                Eigen::Vector3f* surface_L) const {
    Found found{&surfaces_[link], Eigen::Vector3f::Zero()};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    RTCPointQuery query{p_L.x(), p_L.y(), p_L.z(), 0.0F, bound};
    rtcPointQuery(surfaces_[link].scene, &query, &context, visit, &found);
    if (!found.any) return bound;
    *surface_L = found.point;
    return query.radius;
  }

 private:
  RTCDevice device_;
  std::vector<Surface> surfaces_;
};

// Whole groups of pixels are bounded by Embree's distance of their centre.
class Embree : public OfGroups {
 public:
  explicit Embree(const Robot& robot) : OfGroups(robot), surfaces_(robot) {
    name = "Embree point query, hierarchy of spheres over the image";
    is_unsigned = true;
  }

  void query(const Poses& X_FL, std::vector<Answer>* answers) override {
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      const auto distance = [&](const Eigen::Vector3f& p_L, float bound,
                                Eigen::Vector3f* witness_L) {
        // A surface point near the nearest one makes the search short; NaN compares as false.
        const float near = kWiden * (p_L - *witness_L).norm() + kRounding;
        return surfaces_.closest(link, p_L, near < bound ? near : bound, witness_L);
      };
      // The search keeps no surface points of pixels.
      const auto surface = [&](const Eigen::Vector3f& p_L, float /*distance*/) {
        Eigen::Vector3f surface_L = Eigen::Vector3f::Zero();
        surfaces_.closest(link, p_L, std::numeric_limits<float>::infinity(), &surface_L);
        return surface_L;
      };
      (*answers)[link] = find(link, X_FL[link], distance, surface);
    }
  }

 private:
  static constexpr float kWiden = 1.00001F, kRounding = 1e-6F;  // [m]

  Surfaces surfaces_;
};

}  // namespace

void add_embree(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<Embree>(robot));
}

}  // namespace ist::benchmark
