#include "ist_proximity/cloud/ingest.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "cloud/filters/one_place.h"
#include "cloud/filters/self_filter.h"
#include "cloud/filters/zone_filter.h"
#include "cloud/index/near_region.h"
#include "cloud/index/organized_cloud.h"
#include "cloud/index/point_bvh_builder.h"
#include "cloud/index/scene_axes.h"
#include "cloud/index/unorganized_cloud.h"
#include "internal/cloud/largest_range.h"
#include "internal/cloud/point_bvh.h"
#include "internal/cloud/voxel_grid.h"

namespace ist {
namespace {

void require(bool valid, const char* member, double value, const char* range) {
  if (valid) return;
  throw std::invalid_argument(std::string("IngestConfig::") + member + " is " +
                              std::to_string(value) + ", it must be " + range + ".");
}

void check(const ViewFilterConfig& view) {
  const auto is_positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  const auto is_not_negative = [](double value) { return value >= 0.0 && std::isfinite(value); };
  const RangeNoise& noise = view.noise;
  require(is_not_negative(noise.constant), "view.noise.constant", noise.constant, "0 or more");
  require(is_not_negative(noise.quadratic), "view.noise.quadratic", noise.quadratic, "0 or more");
  require(is_positive(view.position_error), "view.position_error", view.position_error,
          "more than 0");
  require(is_positive(view.angle_error), "view.angle_error", view.angle_error, "more than 0");
  require(is_not_negative(view.model_error), "view.model_error", view.model_error, "0 or more");
  require(is_not_negative(view.time_error), "view.time_error", view.time_error, "0 or more");
  require(is_not_negative(view.mixed_pixels), "view.mixed_pixels", view.mixed_pixels, "0 or more");
}

double farthest_point(const IngestConfig& config) {
  return std::min(config.max_range, config.extent.max_range);
}

void check(const IngestConfig& config) {
  require(config.min_range >= 0.0 && std::isfinite(config.min_range), "min_range", config.min_range,
          "0 or more");
  require(config.max_range > config.min_range, "max_range", config.max_range,
          "more than min_range");
  require(config.sensor_range > 0.0, "sensor_range", config.sensor_range, "more than 0");
  require(config.search_distance >= 0.0, "search_distance", config.search_distance, "0 or more");
  require(config.self_filter_padding >= 0.0 && std::isfinite(config.self_filter_padding),
          "self_filter_padding", config.self_filter_padding, "0 or more");
  require(config.thinning >= kSmallestVoxel && std::isfinite(config.thinning), "thinning",
          config.thinning, "1e-9 or more");
  if (config.self_filter_mode == SelfFilterMode::kView) check(config.view);
  require(config.max_points > 0, "max_points", 0.0, "1 or more");
  if (config.extent.is_zero()) return;
  const std::string fault = check_extent(config.extent, farthest_point(config));
  if (!fault.empty()) throw std::invalid_argument("IngestConfig::extent: " + fault + ".");
}

void check(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, const IngestConfig& config) {
  if (!X_FS.matrix().allFinite()) {
    throw std::invalid_argument("the sensor's pose holds a NaN or infinite number.");
  }
  const Eigen::Vector3d& p_FS = X_FS.translation();
  if (!(p_FS.cwiseAbs().maxCoeff() <= kLargestRange)) {
    std::ostringstream text;
    text << "the sensor is at (" << p_FS.x() << ", " << p_FS.y() << ", " << p_FS.z()
         << ") m in the fixed frame, allowed are at most " << kLargestRange << " m.";
    throw std::invalid_argument(text.str());
  }
  if (cloud.size() > config.max_points) {
    throw std::invalid_argument("the cloud has " + std::to_string(cloud.size()) +
                                " points, allowed are at most " +
                                std::to_string(config.max_points) + " (max_points).");
  }
}

// The extent of a cloud's points, without the sensor's place.
// @throws std::invalid_argument where it follows from a camera, and the cloud is no camera's
PointExtent extent_of(const RawCloud& cloud, const IngestConfig& config) {
  PointExtent extent;
  if (config.extent.is_zero()) return extent;
  double angle = 0.0;
  if (config.extent.footprint == ExtentConfig::Footprint::kCamera) {
    angle = pixel_angle(cloud, config.extent.field_of_view);
    if (!(angle > 0.0) && cloud.size() > 0) {
      throw std::invalid_argument(
          "the footprint of a point is asked for, but its angle is not known: the cloud has " +
          std::to_string(cloud.width) + " x " + std::to_string(cloud.height) +
          " points and no camera_info. Give the footprint as an angle or a radius, or for an "
          "organized cloud the field of view.");
    }
  }
  extent = point_extent(config.extent, angle > 0.0 ? angle : 0.0, farthest_point(config));
  const double range = std::min(extent.max_range, kLargestRange);
  if (!(extent.radius(range) <= kMaxExtent && extent.growth(range) <= kMaxExtentGrowth)) {
    std::ostringstream text;
    text << "the footprint of a pixel of " << angle << " rad gives points at max_range, "
         << extent.max_range << " m, a radius of " << extent.radius(range)
         << " m: allowed are at most " << kMaxExtent << " m, and a growth of at most "
         << kMaxExtentGrowth << " m for each metre of range. Lower max_range, or give the "
         << "footprint as an angle or a radius.";
    throw std::invalid_argument(text.str());
  }
  return extent;
}

}  // namespace

struct Ingest::Impl {
  IngestConfig config;
  RegionOfInterest region;
  PointBvhBuilder builder;
  SelfFilter self_filter;
  ZoneFilter zones;
  NearRegion near;
  std::unique_ptr<ViewFilter> view;  // null: the self-filter drops all that is within its padding
  LookedBlocks looked;               // of the cloud that `view` has seen last

  CropParameters crop_of(const RawCloud& cloud, const Eigen::Isometry3d& X_FS) const {
    CropParameters crop = crop_parameters(cloud, X_FS, config);
    limit_to_region(region, X_FS, &crop);
    return crop;
  }

  // Shows a cloud to the view filter, again where that has corrected the sensor's pose by much.
  // @param crop  overwritten: that of the corrected pose
  // @returns the corrected pose by which the cloud is placed
  Eigen::Isometry3d look_at_robot(const RawCloud& cloud, const Eigen::Isometry3d& X_FS,
                                  Span<const PosedSolid> robot, double stamp,
                                  CropParameters* crop) {
    view->begin_cloud(robot, stamp);
    Eigen::Isometry3d X_FC;
    bool again = true;
    while (again) {
      X_FC = X_FS * view->X_SC();
      *crop = crop_of(cloud, X_FC);
      set_axes(scene_axes(cloud, X_FC.linear(), true), crop);
      self_filter.set_poses(robot, crop->X_FO, view->begin_pass(cloud, X_FC));
      again = ist::look_at_robot(cloud, *crop, &self_filter, view.get(), &builder, &looked);
    }
    return X_FC;
  }
};

Ingest::Ingest(const IngestConfig& config) : impl_(std::make_unique<Impl>()) {
  check(config);
  impl_->config = config;
  if (config.self_filter_mode == SelfFilterMode::kView) {
    impl_->view = std::make_unique<ViewFilter>(config.view, config.self_filter_padding);
  }
}

Ingest::~Ingest() = default;
Ingest::Ingest(Ingest&&) noexcept = default;
Ingest& Ingest::operator=(Ingest&&) noexcept = default;

const IngestConfig& Ingest::config() const { return impl_->config; }

void Ingest::set_region_of_interest(const RegionOfInterest& region) {
  if (!region.center_F.allFinite() || !(region.radius >= 0.0)) {
    throw std::invalid_argument("the region's centre is not finite, or its radius no number >= 0.");
  }
  impl_->region = region;
}

void Ingest::set_zones(const std::vector<Zone>& zones, std::size_t kept) {
  impl_->zones.set_zones(zones, kept);
}

void Ingest::run(const RawCloud& cloud, const Eigen::Isometry3d& X_FP, Span<const PosedSolid> robot,
                 double stamp, CloudSnapshot* snapshot, Span<const double> paddings) {
  const auto start = std::chrono::steady_clock::now();
  const IngestConfig& config = impl_->config;
  const Eigen::Isometry3d X_FS = X_FP * Eigen::Translation3d(cloud.origin);
  check(cloud, X_FS, config);
  PointExtent extent = extent_of(cloud, config);
  CropParameters crop = impl_->crop_of(cloud, X_FS);
  bool organized = is_organized(cloud, crop);
  SelfFilter* on_robot = nullptr;
  ViewFilter* view = nullptr;
  snapshot->view.is_used = false;
  snapshot->view.links.clear();
  Eigen::Isometry3d X_FC = X_FS;  // as a view of the robot corrects it
  if (config.self_filter && !robot.empty()) {
    on_robot = &impl_->self_filter;
    if (impl_->view != nullptr && is_view(cloud)) view = impl_->view.get();
  }
  if (view != nullptr) {
    organized = true;  // its pixels are asked about by their places in the image
    X_FC = impl_->look_at_robot(cloud, X_FS, robot, stamp, &crop);
    view->report(&snapshot->view);
  } else {
    set_axes(scene_axes(cloud, X_FS.linear(), organized), &crop);
    if (on_robot != nullptr) {
      on_robot->set_poses(robot, crop.X_FO, config.self_filter_padding, paddings);
    }
  }
  if (!extent.is_zero()) {
    extent.p_FS = X_FC.translation();
    extent.allow_for(cloud.sensor_moved);
  }
  const ZoneFilter* zones = nullptr;
  if (impl_->zones.is_active()) {
    impl_->zones.begin_cloud(crop.X_FO, extent);
    zones = &impl_->zones;
  }
  IngestCounts counts;
  std::size_t kept = 0;
  if (organized) {
    kept = index_organized(cloud, crop, {on_robot, view, zones},
                           view != nullptr ? &impl_->looked : nullptr, &impl_->builder,
                           &snapshot->index.bvh(), &counts);
  } else {
    NearRegion* near = nullptr;
    if (on_robot != nullptr && std::isfinite(config.search_distance)) {
      near = &impl_->near;
      near->start(on_robot->links(), config.search_distance, stamp);
    }
    kept = index_unorganized(cloud, crop, {on_robot, nullptr, zones}, near, &impl_->builder,
                             &snapshot->index.bvh(), &counts);
  }
  counts.received = static_cast<std::uint32_t>(cloud.size());
  counts.out_of_range = counts.received - counts.not_a_number - counts.infinite -
                        counts.outside_region - static_cast<std::uint32_t>(kept);
  counts.used = static_cast<std::uint32_t>(snapshot->index.size());
  counts.on_robot = static_cast<std::uint32_t>(kept) - counts.used - counts.in_zones;
  counts.at_one_place = points_at_one_place(cloud, crop);
  counts.infinite_is_free = cloud.from_rays;
  snapshot->extent = extent;
  snapshot->X_FS = X_FC;
  snapshot->believed_range = std::sqrt(crop.believed_sq);
  snapshot->thinning = config.thinning;
  snapshot->region = impl_->region;
  if (config.thin) snapshot->index.bvh().set_thinning(config.thinning);
  snapshot->counts = counts;
  snapshot->stamp = stamp;
  snapshot->ingest_time =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace ist
