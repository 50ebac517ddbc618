// Ingest::run() against a plain loop in double: what is done with each point, where it is stored,
// and what the thinned cloud holds.
// Covers: src/cloud/ingest.cpp src/cloud/filters src/cloud/index src/cloud/thinning
// Longest input: 1500

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "cloud/format/point_reader.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/tiles.h"

namespace {

using ist::fuzz::ByteReader;

constexpr double kLargest = 1e9;  // [m] farther points are out of range whatever the configuration

/// A cloud with the bytes that hold its points.
struct Message {
  std::shared_ptr<std::vector<std::uint8_t>> bytes = std::make_shared<std::vector<std::uint8_t>>();
  ist::RawCloud raw;
};

void put(double value, const ist::RawCloud& raw, std::uint8_t* to) {
  const auto store = [&](auto number) {
    std::memcpy(to, &number, sizeof number);
    if (raw.swap_bytes) std::reverse(to, to + sizeof number);
  };
  raw.is_double ? store(value) : store(static_cast<float>(value));
}

// An image of a plane with holes and steps, or points anywhere.
Eigen::Vector3d point(ByteReader* in, bool image, std::size_t row, std::size_t column) {
  if (!image) {
    const double x = in->number(4.0), y = in->number(4.0), z = in->number(4.0);
    return {x, y, z};
  }
  const std::uint8_t kind = in->byte();
  if (kind < 20) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  const double depth = kind < 200 ? 1.0 : in->number(3.0);
  return depth * Eigen::Vector3d(0.02 * static_cast<double>(column),
                                 0.02 * static_cast<double>(row), 1.0) +
         Eigen::Vector3d::Constant(1e-4 * kind);
}

Message message_from(ByteReader* in) {
  Message message;
  ist::RawCloud& raw = message.raw;
  const bool image = in->flag();
  raw.width = 1 + in->below(40);
  raw.height = image ? 1 + in->below(24) : 1 + in->below(2);
  raw.is_double = in->flag();
  raw.swap_bytes = in->byte() > 200;
  const std::size_t number = raw.is_double ? 8 : 4;
  raw.x = in->below(3);
  raw.y = raw.x + number + in->below(3);
  raw.z = raw.y + number + in->below(3);
  raw.point_step = raw.z + number + in->below(5);
  raw.row_step = raw.width * raw.point_step + in->below(4);
  const bool owned = in->flag();
  message.bytes->assign(raw.height * raw.row_step, 0xFF);
  raw.data = message.bytes->data();
  for (std::size_t row = 0; row < raw.height; ++row) {
    for (std::size_t column = 0; column < raw.width; ++column) {
      const Eigen::Vector3d p = point(in, image, row, column);
      std::uint8_t* to = message.bytes->data() + row * raw.row_step + column * raw.point_step;
      put(p.x(), raw, to + raw.x);
      put(p.y(), raw, to + raw.y);
      put(p.z(), raw, to + raw.z);
    }
  }
  if (owned) raw.owner = message.bytes;
  return message;
}

ist::IngestConfig config_from(ByteReader* in) {
  ist::IngestConfig config;
  config.min_range = in->between(0.0, 0.5);
  const std::uint8_t far = in->byte();
  config.max_range = far < 180   ? config.min_range + in->between(0.01, 6.0)
                     : far < 220 ? std::numeric_limits<double>::infinity()
                                 : std::pow(10.0, in->between(0.0, 300.0));
  config.self_filter = in->flag();
  config.self_filter_padding = in->between(0.0, 0.1);
  config.thin = in->flag();
  config.thinning = std::pow(10.0, in->between(-6.0, 1.0));
  return config;
}

/// Links of the robot that the self-filter sees.
struct Robot {
  std::vector<ist::Shape> shapes = {ist::Sphere{0.3}, ist::Box{{0.6, 0.4, 0.5}}};
  std::shared_ptr<ist::RobotModel> model = ist::test::make_model(shapes, 0.05);
};

/// What a plain loop does with the points of a cloud. A point at a limit, to within rounding, may
/// be counted on either side.
struct Expected {
  std::size_t not_a_number = 0, infinite = 0;
  std::size_t used = 0, used_at_most = 0;
  std::map<std::uint32_t, Eigen::Vector3d> point_F;  ///< by id; those that are finite and in range
  std::vector<std::uint32_t> certain;                ///< ids that must be used
};

Expected expect(const ist::RawCloud& raw, const Eigen::Isometry3d& X_FS,
                const ist::IngestConfig& config, const ist::RegionOfInterest& region,
                const Robot& robot, const std::vector<Eigen::Isometry3d>& X_FL) {
  Expected expected;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    const Eigen::Vector3d p = ist::point_at(raw, i / raw.width, i % raw.width);
    if (p.array().isNaN().any()) ++expected.not_a_number;
    if (p.array().isInf().any() && !p.array().isNaN().any()) ++expected.infinite;
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 10.0 * kLargest) continue;
    const Eigen::Vector3d p_F = X_FS * p;
    const double largest = std::min(config.max_range, kLargest);
    // How far the point is within each limit [m].
    double inside = std::min(p.norm() - config.min_range, largest - p.norm());
    inside = std::min(inside, region.radius - (p_F - region.center_F).norm());
    if (config.self_filter) {
      for (std::size_t link = 0; link < X_FL.size(); ++link) {
        const Eigen::Vector3d p_L = X_FL[link].inverse() * p_F;
        inside = std::min(
            inside,
            std::visit([&](const auto& s) { return ist::test::oracle_signed_distance(s, p_L); },
                       robot.shapes[link]) -
                config.self_filter_padding);
      }
    }
    const double rounding = 1e-6 * (1.0 + p.norm() + p_F.norm() + X_FS.translation().norm());
    if (inside < -rounding) continue;
    ++expected.used_at_most;
    expected.point_F[static_cast<std::uint32_t>(i)] = p_F;
    if (inside < rounding) continue;
    ++expected.used;
    expected.certain.push_back(static_cast<std::uint32_t>(i));
  }
  return expected;
}

std::map<std::uint32_t, Eigen::Vector3d> stored(const ist::PointIndex& index) {
  std::map<std::uint32_t, Eigen::Vector3d> points;
  for (const ist::PointTile& tile : ist::test::tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) {
      FUZZ_CHECK(points.emplace(tile.id[k], index.X_FO() * tile.point(k)).second, "id %u twice",
                 tile.id[k]);
    }
  }
  FUZZ_CHECK(points.size() == index.size(), "%zu of %zu points", points.size(), index.size());
  return points;
}

void check_counts(const ist::IngestCounts& n, const ist::RawCloud& raw, const Expected& expected) {
  FUZZ_CHECK(n.received == raw.size(), "received %u", n.received);
  const std::uint64_t sum = std::uint64_t{n.not_a_number} + n.infinite + n.out_of_range +
                            n.outside_region + n.noise + n.on_robot + n.used;
  FUZZ_CHECK(sum == n.received, "%llu of %u points are counted",
             static_cast<unsigned long long>(sum), n.received);
  FUZZ_CHECK(n.not_a_number == expected.not_a_number, "%u NaN, not %zu", n.not_a_number,
             expected.not_a_number);
  FUZZ_CHECK(n.infinite == expected.infinite, "%u infinite, not %zu", n.infinite,
             expected.infinite);
  FUZZ_CHECK(n.used >= expected.used && n.used <= expected.used_at_most, "%u used, not %zu to %zu",
             n.used, expected.used, expected.used_at_most);
}

// Near each point there is a thinned one, wherever the other points are.
void check_thinned(const ist::CloudSnapshot& snapshot,
                   const std::map<std::uint32_t, Eigen::Vector3d>& points) {
  const std::map<std::uint32_t, Eigen::Vector3d> thinned =
      ist::test::thinned_points_of(snapshot.index);
  std::size_t in_tiles = 0;
  for (const ist::ThinnedTile& tile : ist::test::thinned_tiles_of(snapshot.index)) {
    in_tiles += static_cast<std::size_t>(tile.count);
  }
  FUZZ_CHECK(in_tiles == thinned.size(), "%zu of %zu thinned points differ", thinned.size(),
             in_tiles);
  FUZZ_CHECK(thinned.size() <= points.size() && thinned.empty() == points.empty(),
             "%zu points thinned to %zu", points.size(), thinned.size());
  const double edge = snapshot.thinning;
  for (const auto& [id, p] : points) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& [other, q] : thinned) nearest = std::min(nearest, (p - q).norm());
    const double rounding = 1e-6 * (1.0 + (p - snapshot.index.X_FO().translation()).norm());
    FUZZ_CHECK(nearest <= 1.733 * edge + rounding,
               "no thinned point within %g m of point %u, voxels of %g m", nearest, id, edge);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Robot robot;
  ByteReader in(data, size);
  const ist::IngestConfig config = config_from(&in);
  ist::Ingest ingest(config);
  ist::RegionOfInterest region;
  if (in.flag()) {
    region.center_F = in.vector(3.0);
    region.radius = in.between(0.0, 5.0);
  }
  ingest.set_region_of_interest(region);
  ist::CloudSnapshot snapshot;
  // The second cloud finds the buffers of the first.
  for (int run = 0; run < 2; ++run) {
    Eigen::Isometry3d X_FS = in.pose(3.0);
    if (in.byte() > 220) X_FS.translation() *= 1e5;
    const std::vector<Eigen::Isometry3d> X_FL = {X_FS * in.pose(1.0), X_FS * in.pose(1.0)};
    const std::vector<ist::PosedSolid> solids = posed_solids(*robot.model, X_FL, {true, true});
    const Message message = message_from(&in);
    ingest.run(message.raw, X_FS, solids, 1.0, &snapshot);
    const Expected expected = expect(message.raw, X_FS, config, region, robot, X_FL);
    check_counts(snapshot.counts, message.raw, expected);
    const std::map<std::uint32_t, Eigen::Vector3d> points = stored(snapshot.index);
    FUZZ_CHECK(points.size() == snapshot.counts.used, "%zu points", points.size());
    for (const std::uint32_t id : expected.certain) {
      FUZZ_CHECK(points.count(id) == 1, "point %u is missing", id);
    }
    const Eigen::Vector3d origin = snapshot.index.X_FO().translation();
    for (const auto& [id, p] : points) {
      const auto found = expected.point_F.find(id);
      FUZZ_CHECK(found != expected.point_F.end(), "point %u must not be used", id);
      const double off = (p - found->second).norm();
      FUZZ_CHECK(off <= 2e-7 * (found->second - origin).norm() + 1e-15 * origin.norm() + 1e-12,
                 "point %u is stored %g m off", id, off);
    }
    if (config.thin) check_thinned(snapshot, points);
  }
  return 0;
}
