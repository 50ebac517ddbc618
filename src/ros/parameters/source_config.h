#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/laser_scan.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/octree.h"
#include "ist_proximity/proximity/known_world.h"

namespace ist {

enum class SourceType { kCloud, kDepthImage, kScan, kMap, kWorld };  // kWorld is the last one

/// The ROS message type of a source, as rostopic writes it; a known world's type in ~sources is
/// "world".
const char* message_type(SourceType type);
/// The word for one message of a source: "cloud", "image", "scan", "map" or "world"; no two types
/// have the same.
const char* noun(SourceType type);

/// What a source remembers (~memory, ~sources/NAME/memory).
struct SourceMemoryConfig {
  bool enabled = false;
  MemoryConfig map;
  std::string file;  ///< absolute path of a .bt file; empty: nothing is kept
};

/// Depth cameras have 10 to 60 % of pixels without a measurement, and lidars up to 85 %, where they
/// look at the sky. What sees less than a tenth does not see the view that it stands for: NO_CLOUD.
constexpr double kMinMeasured = 0.1;

/// An object of ~sources/NAME/objects.
struct WorldObjectConfig {
  WorldObject object;  ///< without geometry where `mesh` is set
  std::string mesh;    ///< URI of a mesh file, which the source's thread reads
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
};

/// Another robot as an obstacle.
struct OtherRobotConfig {
  std::string description;   ///< name of the parameter with its URDF; empty: none
  std::string tf_prefix;     ///< its links' frames in tf are this and the link's name
  std::string joint_states;  ///< topic; empty: the poses of its links come from tf
};

/// The parameters of a source of type `world`.
struct WorldConfig {
  std::string frame_id;  ///< of objects that state none; empty: the fixed frame
  std::vector<WorldObjectConfig> objects;
  OtherRobotConfig robot;
  bool has_topic = false;  ///< whether its topic is subscribed to
  WorldLimits limits;
  double margin = 0.0;  ///< [m] of objects that state none
  /// Pairs of a link and an object that may touch.
  std::vector<std::pair<std::string, std::string>> allowed_contacts;
};

/// One entry of ~sources.
struct SourceConfig {
  std::string name = "cloud";
  SourceType type = SourceType::kCloud;
  std::string topic = "cloud";   ///< as configured: relative to the node's namespace, remappable
  std::string camera_info;       ///< topic, of depth images; empty: camera_info beside `topic`
  std::string file;              ///< absolute path of a map that is read in place of a topic
  std::string frame_id = "map";  ///< frame of the map in `file`
  double timeout = 0.5;          ///< [s] an older message is STALE_CLOUD; > 0, may be inf
  std::string timeout_parameter = "cloud_timeout";
  bool required = true;  ///< false: the absence of this source shows in its own status only
  /// [s] > 0: a source whose messages have held the same bytes for longer is STALE_CLOUD. Infinity:
  /// never, as a simulation without noise repeats itself.
  double frozen_after = std::numeric_limits<double>::infinity();
  double depth_unit = 0.0;  ///< [m] of depth images: that a number of 1 means; 0: the encoding's
  IngestConfig ingest;
  /// [m] self_filter_padding by link, where it is a dictionary; of other links `other_padding`.
  /// Used with kPadding. ingest.self_filter_padding is the largest.
  std::map<std::string, double> link_paddings;
  double other_padding = IngestConfig().self_filter_padding;
  NoiseFilterConfig noise;    ///< used for clouds and depth images
  ScanLimits scan;            ///< used for scans
  OctreeLimits map;           ///< used for maps
  SourceMemoryConfig memory;  ///< used for clouds and depth images
  WorldConfig world;          ///< used for known worlds

  /// Whether a message stays valid for ever and survives jumps of the clock: a map from a file, a
  /// map with an infinite timeout, and the same of a known world.
  bool is_permanent() const;
  /// Whether zones hold for its points: those of a sensor that get stale, as a zone does, and that
  /// are in one place, whatever a self-filter by view makes of it.
  bool has_zones() const;
};

}  // namespace ist
