// doc/accuracy.md states limits of the errors of contact volumes and of the jumps of wrenches. This
// test measures them again: they must stay below the limits, and it must measure every row.
// IST_PROXIMITY_UPDATE_DOC=1 writes the tables.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "support/accuracy.h"
#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;

const std::string kDocument = std::string(IST_PROXIMITY_SOURCE_DIR) + "/doc/accuracy.md";

bool updating() { return std::getenv("IST_PROXIMITY_UPDATE_DOC") != nullptr; }

// Rows of a table: the first columns, and the numbers in the last ones.
using Rows = std::map<std::string, std::vector<double>>;

// The limit stated for a measured value: one and a half times the value, to two digits.
double limit(double value) {
  const double wanted = std::max(1.5 * value, 0.01);
  const double unit = std::pow(10.0, std::floor(std::log10(wanted)) - 1.0);
  return std::ceil(wanted / unit) * unit;
}

std::string table(const std::string& header, const Rows& rows) {
  const auto columns = std::count(header.begin(), header.end(), '|') - 1;
  std::string text = header + "\n|";
  for (long i = 0; i < columns; ++i) text += "---|";
  text += "\n";
  for (const auto& [key, values] : rows) {
    text += "| " + key;
    for (const double value : values) text += " | " + test::number(limit(value));
    text += " |\n";
  }
  return text;
}

void check(const std::string& name, const std::string& header, const Rows& rows) {
  if (updating()) ASSERT_TRUE(test::replace_table(kDocument, name, table(header, rows)));
  std::size_t known = 0;
  for (const std::vector<std::string>& row : test::parse_table(test::read_text(kDocument), name)) {
    const std::size_t width = rows.begin()->second.size();
    ASSERT_GT(row.size(), width);
    std::string key = row[0];
    for (std::size_t i = 1; i + width < row.size(); ++i) key += " | " + row[i];
    SCOPED_TRACE(key);
    const auto found = rows.find(key);
    if (found == rows.end() && test::kSanitized) continue;
    ASSERT_NE(found, rows.end()) << "a row that no test measures";
    ++known;
    for (std::size_t i = 0; i < width; ++i) {
      if (test::kSanitized) continue;  // packings are coarser there
      EXPECT_LE(found->second[i], std::stod(row[row.size() - width + i])) << "column " << i;
    }
  }
  EXPECT_EQ(known, rows.size()) << "a row that is not stated";
}

bool holds(const Shape& shape, const Eigen::Vector3d& p) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return p.norm() < sphere->radius;
  return (p.cwiseAbs() - 0.5 * std::get<Box>(shape).size).maxCoeff() < 0.0;
}

Eigen::Vector3d half_extent(const Shape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape))
    return Eigen::Vector3d::Constant(sphere->radius);
  return 0.5 * std::get<Box>(shape).size;
}

// The overlap of two bodies by counting eighty steps along each axis of the first one's box.
double true_overlap(const Shape& a, const Shape& b, const Eigen::Isometry3d& X_AB) {
  constexpr int kSteps = 80;
  const Eigen::Vector3d half = half_extent(a), step = 2.0 * half / kSteps;
  const Eigen::Isometry3d X_BA = X_AB.inverse();
  long inside = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      for (int k = 0; k < kSteps; ++k) {
        const Eigen::Vector3d p =
            step.cwiseProduct(Eigen::Vector3d(i + 0.5, j + 0.5, k + 0.5)) - half;
        if (holds(a, p) && holds(b, X_BA * p)) ++inside;
      }
    }
  }
  return static_cast<double>(inside) * step.prod();
}

// A sphere as a mesh of its volume, so that its packing has many spheres.
LinkGeometry packed_shape(const Shape& shape) {
  const auto* sphere = std::get_if<Sphere>(&shape);
  if (sphere == nullptr) return one(shape);
  TriangleMesh mesh = test::icosphere(sphere->radius, 3);
  const double volume = 4.0 * M_PI / 3.0 * std::pow(sphere->radius, 3);
  const double scale = std::cbrt(volume / test::signed_volume(mesh));
  for (Eigen::Vector3d& v : mesh.vertices) v *= scale;
  return one(mesh);
}

struct Pair {
  std::string name;
  Shape first, second;
};

std::vector<Pair> pairs() {
  return {{"two spheres", Sphere{0.1}, Sphere{0.07}},
          {"sphere and box", Sphere{0.1}, Box{{0.2, 0.15, 0.1}}},
          {"box and box", Box{{0.2, 0.15, 0.1}}, Box{{0.15, 0.1, 0.12}}}};
}

// Overlaps of at least a twentieth of the smaller body, at random.
std::vector<Eigen::Isometry3d> overlapping_poses(const Pair& pair, int count) {
  test::Rng rng(401);
  const auto volume = [](const Shape& shape) {
    return true_overlap(shape, shape, Eigen::Isometry3d::Identity());
  };
  const double enough = 0.05 * std::min(volume(pair.first), volume(pair.second));
  std::vector<Eigen::Isometry3d> poses;
  while (static_cast<int>(poses.size()) < count) {
    const Eigen::Isometry3d X = test::random_pose(&rng, 0.1);
    if (true_overlap(pair.first, pair.second, X) > enough) poses.push_back(X);
  }
  return poses;
}

// The mean and the largest error in percent.
std::vector<double> percents(const std::vector<double>& errors) {
  double sum = 0.0, largest = 0.0;
  for (const double error : errors) {
    sum += std::abs(error);
    largest = std::max(largest, std::abs(error));
  }
  return {100.0 * sum / static_cast<double>(errors.size()), 100.0 * largest};
}

TEST(ContactDocument, BodyAgainstBody) {
  Rows rows;
  for (const Pair& pair : pairs()) {
    const auto poses = overlapping_poses(pair, test::scaled(20));
    std::vector<double> truths;
    for (const Eigen::Isometry3d& X_AB : poses) {
      truths.push_back(true_overlap(pair.first, pair.second, X_AB));
    }
    for (const int spheres : {50, 200, 1000}) {
      if (test::kSanitized && spheres > 50) continue;  // packing takes too long
      const ContactLink a(packed_shape(pair.first), spheres), b(packed_shape(pair.second), spheres);
      std::vector<double> errors;
      for (std::size_t i = 0; i < poses.size(); ++i) {
        errors.push_back(contact_volume(*a.body, *b.body, poses[i]).volume / truths[i] - 1.0);
      }
      rows[pair.name + " | " + std::to_string(spheres)] = percents(errors);
    }
  }
  check("bodies", "| bodies | spheres each | mean error [%] | largest error [%] |", rows);
}

std::vector<Eigen::Vector3d> samples(const Shape& shape, double spacing) {
  const Eigen::Vector3d half = half_extent(shape);
  std::vector<Eigen::Vector3d> points;
  for (double x = -half.x() + 0.5 * spacing; x < half.x(); x += spacing) {
    for (double y = -half.y() + 0.5 * spacing; y < half.y(); y += spacing) {
      for (double z = -half.z() + 0.5 * spacing; z < half.z(); z += spacing) {
        if (holds(shape, {x, y, z})) points.emplace_back(x, y, z);
      }
    }
  }
  return points;
}

// The second body is a cloud that fills it, its points three to a cell's edge.
TEST(ContactDocument, CloudThatFillsABody) {
  Rows rows;
  for (const Pair& pair : pairs()) {
    const auto poses = overlapping_poses(pair, test::scaled(10));
    const ContactLink link(packed_shape(pair.first), 500, 0.002);
    for (const int cell : {20, 10}) {
      const double thinning = 1e-3 * cell;
      const CloudSnapshot cloud = test::thinned(samples(pair.second, thinning / 3.0), thinning);
      std::vector<double> errors;
      for (const Eigen::Isometry3d& X_AB : poses) {
        const ContactVolume found =
            contact_volume(link.link(), *link.body, X_AB.inverse(), {&cloud});
        errors.push_back(found.volume / true_overlap(pair.first, pair.second, X_AB) - 1.0);
      }
      rows[pair.name + " | " + std::to_string(cell)] = percents(errors);
    }
  }
  check("clouds", "| bodies | cell [mm] | mean error [%] | largest error [%] |", rows);
}

// The largest change of force and torque per step of a path, in percent of the largest on the path.
std::vector<double> jumps(const std::function<ContactVolume(double)>& at, double from, double to) {
  constexpr double kStep = 1e-4;  // [m]
  ContactVolume before = at(from);
  double force = 0.0, step = 0.0, turn = 0.0, turn_step = 0.0;
  for (double s = from + kStep; s <= to; s += kStep) {
    const ContactVolume now = at(s);
    force = std::max(force, now.weighted_normal.norm());
    turn = std::max(turn, now.weighted_moment.norm());
    step = std::max(step, (now.weighted_normal - before.weighted_normal).norm());
    turn_step = std::max(turn_step, (now.weighted_moment - before.weighted_moment).norm());
    before = now;
  }
  // A torque that is rounding error alone counts as none.
  const double percent = turn > 0.01 * force * 0.1 ? 100.0 * turn_step / turn : 0.0;
  return {100.0 * step / force, percent};
}

Eigen::Isometry3d along(double s) {
  return Eigen::Isometry3d(Eigen::Translation3d(s * Eigen::Vector3d(1.0, 0.3, -0.2).normalized()));
}

TEST(ContactDocument, ForcesDoNotJump) {
  Rows rows;
  const ContactLink big(one(Sphere{0.1}), 1), small(one(Sphere{0.04}), 1);
  const ContactLink box(one(Box{{0.2, 0.15, 0.1}}), 500),
      small_box(one(Box{{0.05, 0.04, 0.03}}), 200);
  const auto bodies = [](const ContactLink& a, const ContactLink& b) {
    return [&a, &b](double s) { return contact_volume(*a.body, *b.body, along(s)); };
  };
  rows["sphere through a sphere, concentric"] = jumps(bodies(big, small), -0.15, 0.15);
  rows["sphere through a sphere of its size, concentric"] = jumps(bodies(big, big), -0.21, 0.21);
  rows["sphere through a box"] = jumps(bodies(box, small), -0.16, 0.16);
  rows["small box through a box, wholly inside"] = jumps(bodies(box, small_box), -0.15, 0.15);
  const CloudSnapshot point = test::thinned({Eigen::Vector3d::Zero()});
  const CloudSnapshot block = test::thinned(samples(Box{{0.06, 0.06, 0.06}}, 0.003));
  const auto cloud = [](const ContactLink& a, const CloudSnapshot& obstacle) {
    return [&a, &obstacle](double s) {
      return contact_volume(a.link(), *a.body, along(-s), {&obstacle});
    };
  };
  rows["one point through a sphere, concentric"] = jumps(cloud(big, point), -0.12, 0.12);
  rows["one point through a box"] = jumps(cloud(box, point), -0.12, 0.12);
  rows["filled cloud through a box"] = jumps(cloud(box, block), -0.15, 0.15);
  check("jumps", "| path | force [%] | torque [%] |", rows);
}

}  // namespace
}  // namespace ist
