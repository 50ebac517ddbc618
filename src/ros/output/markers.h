#pragma once

#include <ist_proximity/ProximityArray.h>
#include <std_msgs/ColorRGBA.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The text that a viewer reads in one glance.
struct NearestSummary {
  int link = -1;     ///< the nearest link's place in the array; -1: no link is near
  std::string text;  ///< its distance and name, "clear", or that something is not known
  std_msgs::ColorRGBA color;
};

/// @param max_distance  [m]
/// @param counts  by link of the message: whether it counts, as in ~min_distance; where it has
///                another size, all do
NearestSummary summarize_nearest(const ist_proximity::ProximityArray& proximity,
                                 double max_distance, const std::vector<bool>& counts);

std_msgs::ColorRGBA make_color(double r, double g, double b, double a);

/// The one scale of nearness in rviz: red at touch and in contact, yellow at half of ~max_distance,
/// green from ~max_distance on. Grey for NaN: not known.
/// @param max_distance  [m]
std_msgs::ColorRGBA nearness_color(double distance, double max_distance);

/// The scene that is drawn beside a ProximityArray, in its frame.
struct MarkerScene {
  /// The closest points of a link and of unknown space.
  struct UnseenLine {
    std::size_t link;  ///< place in the array
    Eigen::Vector3d p_FCl, p_FCo;
  };
  Eigen::AlignedBox3d robot;  ///< [m] encloses the robot; empty where it is not known
  std::vector<UnseenLine> unseen;
};

/// The markers that rviz shows. Not thread safe.
class ShownMarkers {
 public:
  /// Adds what deletes those of the last call that are no longer among the markers.
  void complete(visualization_msgs::MarkerArray* markers);

 private:
  std::map<std::pair<std::string, int>, std_msgs::Header> shown_;  ///< by namespace and id
};

/// Draws a ProximityArray for rviz, in its own frame. Namespaces: "distance" (line from obstacle to
/// link), "point_on_link", "point_on_obstacle", "repulsion" (violet arrow) and "text" (name and
/// distance of the nearest links within 0.3 m, and robot_future where it is stated), "unseen" (grey
/// line from a link to the nearest unknown space); the id is the link's place in the array.
/// "nearest" has the ids 0 (the nearest link's distance as a large number, or why it is not known),
/// 1 and 2 (its line and its point, highlighted). The number and below it the labels, the nearest
/// first, are a list above the robot: none lies over another or over the robot in a view from the
/// side, wherever the viewer stands. Colours are those of nearness_color(). Not thread safe.
class ProximityMarkers {
 public:
  /// @param max_distance  [m] distance that is drawn green
  /// @param lifetime      [s] time after which rviz drops a marker that is not renewed, so that no
  ///                      distances stay when the node dies
  ProximityMarkers(double max_distance, double lifetime)
      : max_distance_(max_distance), lifetime_(lifetime) {}

  /// Says which links may be the nearest: those that count in ~min_distance. At first all do.
  void set_counts(const std::vector<bool>& counts) { counts_ = counts; }

  /// Draws every link that is NEAR or CONTACT, and deletes the other markers of the last call.
  visualization_msgs::MarkerArray draw(const ist_proximity::ProximityArray& proximity,
                                       const MarkerScene& scene);

 private:
  using Point = geometry_msgs::Point;
  using Color = std_msgs::ColorRGBA;

  visualization_msgs::Marker& add(const char* ns, std::size_t id, int type, double x, double y,
                                  double z, const Color& color);
  void add_line(const char* ns, std::size_t id, double width, const Color& color, const Point& from,
                const Point& to);
  void add_solid(const char* ns, std::size_t id, int type, double size, const Color& color,
                 const Point& center);
  void add_text(const char* ns, std::size_t id, double height, double above, const Color& color,
                const std::string& text);
  void draw_link(const ist_proximity::LinkProximity& link, std::size_t id);
  void draw_labels(const std::vector<ist_proximity::LinkProximity>& links);
  void draw_nearest(const ist_proximity::ProximityArray& proximity);
  void place_list(const Eigen::AlignedBox3d& robot);

  double max_distance_, lifetime_;
  std::vector<bool> counts_;  ///< by link; where its size is not the message's, all count
  std_msgs::Header header_;
  /// [m] lower edge of the large number, above the labels; the first place of a robot that is known
  /// is taken at once
  Eigen::Vector3d list_position_{0.0, 0.0, 1.0};
  bool is_placed_ = false;
  std::vector<visualization_msgs::Marker> drawn_;  ///< by draw(), so far
  ShownMarkers shown_;
};

/// Draws the largest inner spheres of some links in the links' own frames, so that rviz moves them
/// along. Each link has a namespace of its own. They are grey.
/// @param links         indices into the model
/// @param max_per_link  largest number of spheres of one link
visualization_msgs::MarkerArray sphere_markers(const RobotModel& model,
                                               const std::vector<std::size_t>& links,
                                               std::size_t max_per_link);

}  // namespace ist
