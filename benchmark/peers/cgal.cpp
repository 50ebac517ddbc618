#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <cmath>
#include <vector>

#include "peers/flat.h"

// CGAL's AABB tree of triangles, for every point that the link's box does not prune.
namespace ist::benchmark {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Kernel::Point_3 to_cgal(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

class Cgal : public PrunedByBox {
 public:
  explicit Cgal(const Robot& robot) : PrunedByBox(robot) {
    name = "CGAL AABB tree, link boxes";
    triangles_.resize(robot.meshes.size());
    for (std::size_t link = 0; link < robot.meshes.size(); ++link) {
      const TriangleMesh& mesh = robot.meshes[link];
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        const Kernel::Triangle_3 triangle(to_cgal(mesh.corner(t, 0)), to_cgal(mesh.corner(t, 1)),
                                          to_cgal(mesh.corner(t, 2)));
        // CGAL does not allow triangles without area; their edges belong to their neighbours.
        if (!triangle.is_degenerate()) triangles_[link].push_back(triangle);
      }
      trees_.push_back(std::make_unique<Tree>(triangles_[link].begin(), triangles_[link].end()));
      trees_.back()->build();
    }
  }

 protected:
  bool closest(std::size_t link, const Eigen::Vector3f& p_L, float* distance,
               Eigen::Vector3d* surface_L) override {
    const Kernel::Point_3 p = to_cgal(p_L.cast<double>());
    Kernel::Point_3 q;
    if (std::isfinite(*distance)) {
      // The hint is as far away as the best answer: farther triangles are pruned.
      const Kernel::Point_3 hint(p.x() + static_cast<double>(*distance), p.y(), p.z());
      q = trees_[link]->closest_point(p, hint);
    } else {
      q = trees_[link]->closest_point(p);
    }
    const auto found = static_cast<float>(std::sqrt(CGAL::squared_distance(p, q)));
    if (!(found < *distance * (1.0F - 1e-6F))) return false;
    *distance = found;
    *surface_L = {q.x(), q.y(), q.z()};
    return true;
  }

 private:
  std::vector<Triangles> triangles_;
  std::vector<std::unique_ptr<Tree>> trees_;
};

}  // namespace

void add_cgal(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<Cgal>(robot));
}

}  // namespace ist::benchmark
