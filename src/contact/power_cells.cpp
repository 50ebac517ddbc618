#include "contact/power_cells.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "contact/lens.h"

namespace ist {
namespace {

constexpr double kGridPoints = 60000.0;

double sphere_volume(double radius) { return 4.0 * M_PI / 3.0 * radius * radius * radius; }

bool overlaps_another(const std::vector<InnerSphere>& spheres, std::size_t i) {
  const double own = sphere_volume(spheres[i].radius);
  double sum = 0.0;
  for (const InnerSphere& other : spheres) {
    sum += lens_volume(spheres[i].radius, other.radius, (spheres[i].center - other.center).norm());
  }
  return sum > (1.0 + 1e-9) * own;  // its own lens is one of them
}

/// The sphere of least power.
std::size_t least_power(const std::vector<InnerSphere>& spheres, const Eigen::Vector3d& p) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double power =
        (p - spheres[i].center).squaredNorm() - spheres[i].radius * spheres[i].radius;
    if (power >= least) continue;
    least = power;
    best = i;
  }
  return best;
}

/// The fraction of a grid cell on the positive side of a surface, as if that were flat and parallel
/// to the grid. All or nothing would miss half a cell along whole faces.
/// @param distance  [m] signed, of the cell's centre from the surface
double fraction_of_cell(double distance, double step) {
  return std::clamp(0.5 + distance / step, 0.0, 1.0);
}

/// [m^3] of a sphere's power cell, by a grid.
struct CellVolumes {
  double in_sphere = 0.0;
  double in_void = 0.0;  ///< in the link and outside the sphere
};

std::vector<CellVolumes> measure_cells(const std::vector<InnerSphere>& spheres,
                                       const Eigen::AlignedBox3d& box, const Solid& solid) {
  std::vector<CellVolumes> volumes(spheres.size());
  const double step = std::cbrt(box.volume() / kGridPoints);
  const Eigen::Array3d counts = (box.sizes().array() / step).ceil().max(1.0);
  const Eigen::Array3d steps = box.sizes().array() / counts;
  for (double x = 0.5; x < counts.x(); ++x) {
    for (double y = 0.5; y < counts.y(); ++y) {
      for (double z = 0.5; z < counts.z(); ++z) {
        const Eigen::Vector3d p = box.min() + (Eigen::Array3d(x, y, z) * steps).matrix();
        const std::size_t i = least_power(spheres, p);
        const double outside =
            fraction_of_cell((p - spheres[i].center).norm() - spheres[i].radius, step);
        volumes[i].in_sphere += steps.prod() * (1.0 - outside);
        if (!(outside > 0.0)) continue;
        const double inside = fraction_of_cell(-solid.signed_distance(p).distance, step);
        // In a void thinner than a cell, sphere and surface are about parallel.
        volumes[i].in_void += steps.prod() * std::max(outside + inside - 1.0, 0.0);
      }
    }
  }
  return volumes;
}

}  // namespace

PowerCells::PowerCells(const std::vector<InnerSphere>& spheres, const Eigen::AlignedBox3d& box,
                       const Solid& solid) {
  const std::vector<CellVolumes> cells = measure_cells(spheres, box, solid);
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double own = sphere_volume(spheres[i].radius);
    const double counted = overlaps_another(spheres, i) ? std::min(own, cells[i].in_sphere) : own;
    ratio.push_back((counted + cells[i].in_void) / own);
    volume += counted + cells[i].in_void;
    packed_volume += counted;
  }
}

}  // namespace ist
