#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/filters/self_filter.h"
#include "cloud/filters/tile_view.h"
#include "cloud/filters/view_calibration.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/view_filter.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

/// Whether neighbours in the message were measured along neighbouring rays from the sensor frame's
/// origin, as those of a camera or a spinning lidar are. Samples some pixels.
bool is_view(const RawCloud& cloud);

/// Decides which points of an organized cloud are the robot's by where the sensor must see it
/// (doc/sources.md). Only tiles of 4 x 4 pixels with points within the padding of a link are
/// looked at; of those points it says which are obstacles all the same. What the padding keeps, it
/// keeps too, but for single pixels and pairs that noise may have put in front of the robot.
///
/// A pass over a cloud is: begin_pass(), add_tile() for every tile near the robot, end_pass(), then
/// robot_mask(). Keeps its memory. Not thread safe.
class ViewFilter {
 public:
  /// @param padding  [m] of the SelfFilter
  ViewFilter(const ViewFilterConfig& config, double padding);

  /// Begins a cloud of another instant.
  /// @param solids  the robot at the cloud's stamp
  /// @param stamp   [s]
  void begin_cloud(Span<const PosedSolid> solids, double stamp);
  /// The estimated correction of the sensor's pose.
  const Eigen::Isometry3d& X_SC() const { return calibration_.X_SC(); }

  /// Begins a pass: the first one, or one that end_pass() has asked for.
  /// @param X_FS  corrected sensor frame -> fixed frame
  /// @returns [m] the padding of this pass. It is larger than the filter's while the sensor's pose
  ///          is not known well enough for its points to be within that
  double begin_pass(const RawCloud& cloud, const Eigen::Isometry3d& X_FS);
  /// Adds a tile that may hold points of the robot.
  /// @param row, column  of its first pixel
  /// @param kept         bit 4 r + c: the pixel in row r and column c is in range
  /// @param filter       its group holds the tile, which it has tested last
  /// @param verdict      of that test
  /// @param X_OS         sensor frame -> the frame of `filter`
  void add_tile(std::size_t row, std::size_t column, std::uint32_t kept, const SelfFilter& filter,
                SelfFilter::Verdict verdict, const Eigen::Isometry3d& X_OS);
  /// Tells of points near the robot, but outside its skin: what was there a cloud ago and is in the
  /// skin now is an obstacle that came in.
  void add_outside(const Eigen::Vector3d& p_F);
  /// Decides about the tiles. @returns whether another pass over the same cloud is worthwhile,
  /// because the correction has changed
  bool end_pass();

  /// Whether a tile was added in this pass, and which of its pixels are the robot's.
  /// @param row, column  of its first pixel
  const std::uint16_t* robot_mask(std::size_t row, std::size_t column) const;

  void report(ViewReport* report) const;

 private:
  static constexpr std::size_t kPixels = TileView::kPixels;
  static constexpr double kFlat = 0.0005;  ///< [m] a patch of surface deviates less from a plane
  // Standard deviations of noise. A camera shows the robot in some 10^4 windows thirty times a
  // second: a mean that is five off by chance comes once in ten seconds, one of three next to an
  // obstacle only where there is one.
  static constexpr double kCertain = 5.0;
  // A pixel outside the skin belongs to an obstacle in the skin if it is in front of the robot by
  // no more than this many standard deviations beyond the padding. A surface has no larger step
  // from one pixel to the next, either.
  static constexpr double kFront = 3.0;

  struct LinkState {
    const InnerSphereTree* tree = nullptr;
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity(), X_LS = Eigen::Isometry3d::Identity();
    double speed = 0.0;       // [m/s] of its fastest point
    double tolerance = 0.0;   // [m] systematic error of its surface in this view
    double blind_skin = 0.0;  // [m]
    std::uint32_t in_skin = 0, unexplained = 0;
  };
  struct Tile {
    std::uint32_t row, column;
    const SelfFilter::Link* link = nullptr;  // whose surface is expected here
    std::array<float, 16> range;             // [m] of the points, by pixel, where kept
    std::array<float, 16> height;            // [m] in front of the surface, by pixel; NaN: not used
    std::uint16_t kept = 0;                  // pixels in range
    std::uint16_t robot = 0;                 // pixels that are the robot's unless they are in front
    std::uint16_t skin = 0;                  // pixels within the padding
    std::uint16_t obstacle = 0;              // of these, those that are obstacles beyond doubt
    std::uint16_t front = 0;                 // pixels in front of the robot, outside its skin
    std::uint16_t stray = 0;                 // of these, those that noise alone may have put there
    std::uint16_t certain = 0;  // pixels that are obstacles by what they show themselves
    std::uint16_t blurred = 0;  // pixels that pass a link by no more than the blur of its edge
    std::uint16_t near = 0;     // pixels that are obstacles, those next to others included
    int count = 0;              // of heights
    float sum = 0.0F, variance = 0.0F;  // [m], [m^2] of heights, and of their noise
    float tolerance = 0.0F;             // [m]
    bool is_patch = false;              // a whole patch of smooth surface
    bool is_obstacle = false;
    bool is_speckle = false;   // too few pixels are in front
    Eigen::Vector3f p_S, n_S;  // middle and normal, where there is a height
  };

  // The tests that say which points of a tile are in the skin.
  struct Skin {
    const SelfFilter& filter;
    SelfFilter::Verdict verdict;
    const Eigen::Isometry3d& X_OS;
  };
  const SelfFilter::Link* skin_of(std::size_t k, const TileView::Sight& sight,
                                  const Skin& skin) const;
  bool add_patch(Tile* tile);
  void add_pixel(std::size_t k, const Skin& skin, Tile* tile);
  void add_height(std::size_t k, double height, double noise, Tile* tile) const;
  enum class Passing { kObstacle, kBlurred, kRobot };
  Passing pass(std::size_t k, const SelfFilter& filter) const;

  Tile* tile_at(std::int64_t row, std::int64_t column);
  const Tile* tile_at(std::int64_t row, std::int64_t column) const;
  bool is_in_front(double sum, double variance, int count, double tolerance, double sigmas) const;
  float largest_step(float range) const;
  bool is_same_surface(const Tile& a, const Tile& b) const;
  bool is_surface_in_front(const Tile& tile, std::size_t k) const;
  void find_obstacles();
  void find_windows(std::size_t index);
  void grow();
  bool came_in(const Tile& tile) const;
  int count_others(std::int64_t row, std::int64_t column, float last) const;
  bool is_alone(const Tile& tile, std::size_t k) const;
  void drop_speckles();
  bool continues(std::int64_t row, std::int64_t column, float range, float step) const;
  void grow_pixels(float sigmas);
  enum class Outside { kInFront, kAll };
  int count_obstacles(std::int64_t row, std::int64_t column, Outside outside) const;
  void finish(Tile* tile);
  std::uint64_t voxel(const Eigen::Vector3d& p_F, int dx, int dy, int dz) const;

  ViewFilterConfig config_;
  double padding_;
  double skin_;  // [m] padding of this pass
  ViewCalibration calibration_;
  int first_passes_ = 0;   // that are left: one that counts patches, then wide ones
  unsigned searched_ = 0;  // clouds without the robot in view
  std::vector<LinkState> links_, last_links_;
  double stamp_ = 0.0, last_stamp_ = 0.0;
  const RawCloud* cloud_ = nullptr;
  Eigen::Isometry3d X_FS_ = Eigen::Isometry3d::Identity();
  double pixel_ = 0.0;  // [rad] between neighbours
  std::size_t tiles_wide_ = 0, tiles_high_ = 0;
  std::vector<std::int32_t> tile_index_;  // by place in the image; -1: none
  TileView view_;                         // of the tile that is added
  std::vector<Tile> tiles_;
  std::vector<std::size_t> front_;                       // tiles to grow from
  std::vector<std::uint64_t> outside_, outside_before_;  // sorted voxels with obstacles
};

}  // namespace ist
