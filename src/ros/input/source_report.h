#pragma once

#include <ros/time.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// A status constant of ProximityArray, and a sentence unless it is OK.
struct Status {
  std::uint8_t code;
  std::string text;
  bool ok() const { return code == 0; }
};

/// All that the status of a source depends on. Times are seconds of the ROS clock; counts begin at
/// the start, the number of messages also when the clock jumps back.
struct SourceReport {
  std::string name;
  std::string topic;  ///< resolved; the path where is_file
  std::string type = "sensor_msgs/PointCloud2";
  std::string noun = "cloud";  ///< the word for one message
  bool is_file = false;        ///< a map file: read once and never stale
  bool is_memory = false;      ///< what another source remembers: as fresh as that one
  /// Whether it can say what is free: a sensor, or a map that is measured again and again. Known
  /// worlds and maps that stay for ever state what is there.
  bool measures = true;
  double timeout = 0.5;                             ///< [s]
  std::string timeout_parameter = "cloud_timeout";  ///< its name
  bool required = true;
  double min_measured = 0.0;  ///< the share of the points that has to be measured
  double sensor_range = 0.0;  ///< [m] farther points are not believed
  /// [s] For how long messages may hold the same bytes; and when the first message came that held
  /// the newest one's. NaN: nobody asks.
  double frozen_after = std::numeric_limits<double>::infinity();
  double same_since = std::numeric_limits<double>::quiet_NaN();
  /// [m] Points this near to a link are taken for the robot, so obstacles in this skin are not
  /// seen. NaN without self-filter.
  double blind_skin = std::numeric_limits<double>::quiet_NaN();
  /// Whether the self-filter is to decide by view; `blind_skin` is the padding then.
  bool by_view = false;
  std::uint64_t messages = 0;      ///< received
  std::uint64_t out_of_order = 0;  ///< dropped: older than the cloud in use
  std::uint64_t overtaken = 0;     ///< dropped: a newer one was ready first
  std::uint64_t shown = 0;         ///< published on ~filtered_cloud, while it has subscribers
  std::uint64_t restarts = 0;      ///< times that the stamps went back and were taken all the same
  std::uint64_t unusable = 0;      ///< dropped: malformed, in the future, or without transform
  std::uint32_t publishers = 0;
  bool has_been_there = false;  ///< a publisher or a message, at any time since the start
  /// The advice until the first message: what the master knows of the topic and of others; may be
  /// empty.
  std::string advice;
  double ahead = 0.0;  ///< [s] of the newest message's stamp at its receipt
  /// Newest stamp received, or its receipt where it was ahead of the clock, except for stamps far
  /// in the future; NaN: none.
  double newest = std::numeric_limits<double>::quiet_NaN();
  /// [s] since reading and ingesting the present message began; 0: there is none.
  double working = 0.0;
  double last_work = 0.0;       ///< [s] what reading and ingesting the last message took
  double warm_up_time = 0.0;    ///< [s] what its first answer took; 0: there was no warm-up
  std::string problem;          ///< why the last message is not in use (yet); empty when it is
  std::string alternation;      ///< why messages hide what others show; empty: they do not
  std::string doubt;            ///< about messages that are used all the same; empty: none
  std::string doubt_of_sender;  ///< that it is gone, and what it told is held; empty: none
  std::string doubt_of_place;   ///< about where its frame is, or doubt_of_sender; empty: none
  /// Objects of a known world that cannot be used, though others can, or what the source's memory
  /// has lost; empty: none.
  std::string incomplete;

  bool has_snapshot = false;  ///< whether a cloud is in use; the members below describe it
  ros::Time stamp;
  ros::Time counts_from;     ///< the age counts from then
  double ingest_time = 0.0;  ///< [s]
  IngestCounts counts;
  std::size_t snapshot_memory = 0;                     ///< [bytes] of its index of points
  std::size_t memory_voxels = 0, memory_occupied = 0;  ///< of a memory
  ViewReport view;                                     ///< of a self-filter by view
  std::vector<std::string> view_links;                 ///< names of view.links

  Status status{0, ""};  ///< what follows from all that; whoever asks for the report decides it
};

/// A sentence when the points on the robot say that the sensor's pose in tf is wrong; else empty.
std::string doubt_of_view(const ViewReport& view);

}  // namespace ist
