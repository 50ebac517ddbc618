#include "support/hard_shapes.h"

namespace ist::test {

void MeshBuilder::triangle(const Point& a, const Point& b, const Point& c) {
  mesh_.triangles.push_back({vertex(a), vertex(b), vertex(c)});
}

void MeshBuilder::quad(const Point& a, const Point& b, const Point& c, const Point& d) {
  triangle(a, b, c);
  triangle(a, c, d);
}

std::uint32_t MeshBuilder::vertex(const Point& p) {
  const auto next = static_cast<std::uint32_t>(mesh_.vertices.size());
  const auto [found, is_new] = vertices_.emplace(std::array{p.x(), p.y(), p.z()}, next);
  if (is_new) mesh_.vertices.push_back(p);
  return found->second;
}

TriangleMesh chazelle(int notches, double gap, double size) {
  using Point = Eigen::Vector3d;
  const double side = notches + 1, half_width = 0.04;
  const double unit = size / side;
  const double above = notches * side + 1.0, below = -1.0;
  const double epsilon = gap / unit;
  MeshBuilder builder;
  // One half: wedges along u, side by side in v, from the plane w = top down to the line
  // w = slope i u + shift, with the two walls u = 0 and u = side.
  const auto half = [&](auto&& to_xyz, double top, double floor, double slope, double shift) {
    const auto point = [&](double u, double v, double w) { return Point(unit * to_xyz(u, v, w)); };
    const auto low = [&](double u, int i) { return point(u, i, slope * i * u + shift); };
    const auto strip = [&](double v0, double v1) {
      builder.quad(point(0, v0, top), point(side, v0, top), point(side, v1, top),
                   point(0, v1, top));
    };
    strip(0.0, 1.0 - half_width);
    for (int i = 1; i <= notches; ++i) {
      const double left = i - half_width, right = i + half_width;
      builder.quad(point(0, left, top), point(side, left, top), low(side, i), low(0, i));
      builder.quad(low(0, i), low(side, i), point(side, right, top), point(0, right, top));
      strip(right, i < notches ? i + 1.0 - half_width : side);
    }
    for (const double u : {0.0, side}) {
      const auto face = [&](const Point& a, const Point& b, const Point& c) {
        u > 0.0 ? builder.triangle(a, b, c) : builder.triangle(a, c, b);
      };
      const Point corner = point(u, 0, floor), far = point(u, side, floor);
      face(corner, low(u, 1), point(u, 1.0 - half_width, top));
      face(corner, point(u, 1.0 - half_width, top), point(u, 0, top));
      for (int i = 1; i < notches; ++i) {
        const Point next = point(u, i + 1.0 - half_width, top);
        face(corner, low(u, i + 1), low(u, i));
        face(low(u, i), low(u, i + 1), next);
        face(low(u, i), next, point(u, i + half_width, top));
      }
      face(corner, far, low(u, notches));
      face(low(u, notches), far, point(u, side, top));
      face(low(u, notches), point(u, side, top), point(u, notches + half_width, top));
    }
  };
  // Heights are divided by `side`, for a block about as high as it is wide.
  half([&](double u, double v, double w) { return Point(u, v, w / side); }, above, below, 1.0,
       epsilon * side);
  half([&](double u, double v, double w) { return Point(v, u, -w / side); }, -below, -above, -1.0,
       0.0);
  return builder.mesh();
}

TriangleMesh sliver_plate(double length, double width, double thickness, int strips) {
  MeshBuilder builder;
  const double x = 0.5 * length, z = 0.5 * thickness;
  const auto y = [&](int i) { return width * (static_cast<double>(i) / strips - 0.5); };
  for (int i = 0; i < strips; ++i) {
    const double y0 = y(i), y1 = y(i + 1);
    builder.quad({-x, y0, z}, {x, y0, z}, {x, y1, z}, {-x, y1, z});
    builder.quad({-x, y0, -z}, {-x, y1, -z}, {x, y1, -z}, {x, y0, -z});
    builder.quad({x, y0, -z}, {x, y1, -z}, {x, y1, z}, {x, y0, z});
    builder.quad({-x, y0, -z}, {-x, y0, z}, {-x, y1, z}, {-x, y1, -z});
  }
  const double y0 = y(0), y1 = y(strips);
  builder.quad({-x, y0, -z}, {x, y0, -z}, {x, y0, z}, {-x, y0, z});
  builder.quad({-x, y1, -z}, {-x, y1, z}, {x, y1, z}, {x, y1, -z});
  return builder.mesh();
}

TriangleMesh needle(double length, double radius) {
  using Point = Eigen::Vector3d;
  const Point tip(0, 0, 0);
  const std::array<Point, 4> base = {Point(radius, 0, -length), Point(0, radius, -length),
                                     Point(-radius, 0, -length), Point(0, -radius, -length)};
  MeshBuilder builder;
  for (std::size_t i = 0; i < 4; ++i) builder.triangle(base[i], base[(i + 1) % 4], tip);
  builder.quad(base[0], base[3], base[2], base[1]);
  return builder.mesh();
}

}  // namespace ist::test
