#include "ist_proximity/proximity/world_file.h"

#include <Eigen/Geometry>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <set>
#include <utility>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/regular_file.h"

namespace ist {
namespace {

constexpr int kConeSides = 128;
constexpr double kHalfSpaceSize = 100.0, kHalfSpaceDepth = 10.0;  // [m]

// A fault in the text, at a line.
struct SceneError {
  std::string what;
};

// Words and lines of a text. Numbers need no locale's decimal point, and are finite.
class Scanner {
 public:
  explicit Scanner(const std::string& text) : text_(text) {}

  bool at_end() {
    skip_space();
    return at_ >= text_.size();
  }

  std::string line() {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string found = text_.substr(at_, end - at_);
    at_ = std::min(end + 1, text_.size());
    ++line_;
    const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!found.empty() && is_space(found.back())) found.pop_back();
    std::size_t first = 0;
    while (first < found.size() && is_space(found[first])) ++first;
    return found.substr(first);
  }

  std::string word(const char* what) {
    skip_space();
    const std::size_t first = at_;
    while (at_ < text_.size() && !is_blank(text_[at_])) ++at_;
    if (first == at_) fail(std::string("it ends where ") + what + " is needed");
    return text_.substr(first, at_ - first);
  }

  double number(const char* what) {
    const std::string found = word(what);
    char* end = nullptr;
    // A long word is no number; strtod reads decimal points only in the locale "C", as ROS has it.
    const double value = std::strtod(found.c_str(), &end);
    if (end != found.c_str() + found.size() || !std::isfinite(value)) {
      fail("'" + printable(found) + "' is no finite number, where " + what + " is needed");
    }
    return value;
  }

  std::size_t count(const char* what, std::size_t allowed) {
    const double value = number(what);
    if (!(value >= 0.0 && value <= static_cast<double>(allowed)) || value != std::floor(value)) {
      fail(std::string(what) + " is " + std::to_string(value) + "; allowed is a whole number to " +
           std::to_string(allowed));
    }
    return static_cast<std::size_t>(value);
  }

  Eigen::Vector3d vector(const char* what) {
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k) v[k] = number(what);
    return v;
  }

  Eigen::Isometry3d pose(const char* what) {
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.translation() = vector(what);
    double q[4];
    for (double& element : q) element = number(what);
    const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
    if (!(std::abs(rotation.norm() - 1.0) < 1e-2)) {
      fail(std::string(what) + " has a quaternion of length " + std::to_string(rotation.norm()));
    }
    X.linear() = rotation.normalized().toRotationMatrix();
    return X;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw SceneError{"line " + std::to_string(line_) + ": " + what};
  }

  // Whether the next line holds several words: new files have a pose there, old ones a number.
  bool next_line_has_words() const {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    bool in_word = false;
    int words = 0;
    for (std::size_t i = at_; i < end; ++i) {
      const bool blank = is_blank(text_[i]);
      if (!blank && !in_word) ++words;
      in_word = !blank;
    }
    return words > 1;
  }

 private:
  static bool is_blank(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }
  void skip_space() {
    while (at_ < text_.size() && is_blank(text_[at_])) {
      if (text_[at_] == '\n') ++line_;
      ++at_;
    }
  }

  const std::string& text_;
  std::size_t at_ = 0, line_ = 1;
};

TriangleMesh read_mesh(Scanner* in, std::size_t allowed) {
  TriangleMesh mesh;
  // A vertex that no triangle names costs memory as well.
  const std::size_t vertices = in->count("the number of vertices", 3 * allowed);
  const std::size_t triangles = in->count("the number of triangles", allowed);
  if (vertices == 0 || triangles == 0) in->fail("a mesh needs vertices and triangles");
  for (std::size_t i = 0; i < vertices; ++i) mesh.vertices.push_back(in->vector("a vertex"));
  for (std::size_t i = 0; i < triangles; ++i) {
    TriangleMesh::Triangle triangle{};
    for (std::uint32_t& corner : triangle) {
      corner = static_cast<std::uint32_t>(in->count("a vertex's number", vertices - 1));
    }
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

GeometryElement read_element(Scanner* in, std::size_t triangles_allowed) {
  const std::string type = in->word("a shape");
  GeometryElement element;
  element.source = type;
  const auto size = [&](const char* what) {
    const double value = in->number(what);
    const std::string fault = size_fault(what, value);
    if (!fault.empty()) in->fail(fault);
    return value;
  };
  if (type == "box") {
    const double x = size("the box's size along x"), y = size("the box's size along y");
    element.shape = Box{{x, y, size("the box's size along z")}};
  } else if (type == "sphere") {
    element.shape = Sphere{size("the sphere's radius")};
  } else if (type == "cylinder" || type == "cone") {
    const double radius = size("its radius"), length = size("its length");
    element.shape = type == "cone" ? Shape(cone(radius, length)) : Shape(Cylinder{radius, length});
  } else if (type == "plane") {
    const Eigen::Vector3d n = in->vector("the plane's normal");
    const double d = in->number("the plane's offset");
    if (!(n.norm() > 1e-9)) in->fail("the plane's normal is zero");
    element = half_space(n.normalized(), -d / n.norm());
  } else if (type == "mesh") {
    element.shape = read_mesh(in, triangles_allowed);
  } else {
    in->fail("'" + printable(type) +
             "' is no shape; known are box, sphere, cylinder, cone, plane, mesh");
  }
  element.X_LE = in->pose("the shape's pose") * element.X_LE;
  return element;
}

std::size_t triangles_of(const GeometryElement& element) {
  const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
  return mesh != nullptr ? mesh->triangles.size() : 0;
}

void skip_subframes(Scanner* in) {
  const std::size_t subframes = in->count("the number of subframes", kMaxElements);
  for (std::size_t i = 0; i < subframes; ++i) {
    in->word("a subframe's name");
    in->pose("a subframe's pose");
  }
}

void read_objects(Scanner* in, const std::string& frame, const WorldLimits& limits,
                  std::vector<WorldObject>* objects) {
  in->line();  // the scene's name
  std::set<std::string> names;
  std::size_t triangles = 0, shapes_read = 0;
  bool is_first = true, has_poses = false;
  while (true) {
    const std::string marker = in->word("'*' or '.'");
    if (marker == ".") return;
    if (marker != "*") in->fail("'" + printable(marker) + "' comes where '*' or '.' is needed");
    WorldObject object;
    object.frame = frame;
    object.name = in->line();
    if (!names.insert(object.name).second) {
      in->fail("it names object '" + printable(object.name) + "' twice; names must be unique");
    }
    if (is_first) has_poses = in->next_line_has_words();
    is_first = false;
    if (has_poses) object.X_BO = in->pose("the object's pose");
    const std::size_t shapes = in->count("the number of shapes", limits.max_objects - shapes_read);
    shapes_read += shapes;
    for (std::size_t i = 0; i < shapes; ++i) {
      object.geometry.push_back(read_element(in, limits.max_triangles - triangles));
      triangles += triangles_of(object.geometry.back());
      if (triangles > limits.max_triangles) {
        in->fail("it holds more than " + std::to_string(limits.max_triangles) +
                 " triangles (max_triangles)");
      }
      for (int k = 0; k < 4; ++k) in->number("a colour");
    }
    if (has_poses) skip_subframes(in);
    objects->push_back(std::move(object));
    if (objects->size() > limits.max_objects) {
      in->fail("it holds more than " + std::to_string(limits.max_objects) +
               " objects (max_objects)");
    }
  }
}

}  // namespace

TriangleMesh cone(double radius, double length) {
  TriangleMesh mesh;
  // The sides touch the circle, the corners are outside of it.
  const double outer = radius / std::cos(kPi / kConeSides);
  for (int i = 0; i < kConeSides; ++i) {
    const double angle = 2.0 * kPi * i / kConeSides;
    mesh.vertices.emplace_back(outer * std::cos(angle), outer * std::sin(angle), -0.5 * length);
  }
  mesh.vertices.emplace_back(0.0, 0.0, -0.5 * length);
  mesh.vertices.emplace_back(0.0, 0.0, 0.5 * length);
  constexpr std::uint32_t kBase = kConeSides, kTip = kConeSides + 1;
  for (std::uint32_t i = 0; i < kConeSides; ++i) {
    const std::uint32_t next = (i + 1) % kConeSides;
    mesh.triangles.push_back({kBase, next, i});
    mesh.triangles.push_back({kTip, i, next});
  }
  return mesh;
}

GeometryElement half_space(const Eigen::Vector3d& n, double offset) {
  GeometryElement element;
  element.source = "plane";
  element.shape = Box{{kHalfSpaceSize, kHalfSpaceSize, kHalfSpaceDepth}};
  element.X_LE.linear() =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), n).toRotationMatrix();
  element.X_LE.translation() = (offset - 0.5 * kHalfSpaceDepth) * n;
  return element;
}

SceneFile parse_scene(const std::string& text, const std::string& frame,
                      const WorldLimits& limits) {
  SceneFile scene;
  Scanner in(text);
  try {
    if (in.at_end()) in.fail("it is empty");
    read_objects(&in, frame, limits, &scene.objects);
  } catch (const SceneError& error) {
    scene.objects.clear();
    scene.fault = "no MoveIt scene that can be read, " + error.what;
  }
  return scene;
}

SceneFile read_scene_file(const std::string& path, const std::string& frame,
                          const WorldLimits& limits) {
  SceneFile scene;
  std::string text;
  scene.fault = read_regular_file(path, kMaxMeshFileSize, &text);
  if (!scene.fault.empty()) {
    scene.fault = "world file '" + printable(path) + "' " + scene.fault;
    return scene;
  }
  scene = parse_scene(text, frame, limits);
  if (!scene.fault.empty()) scene.fault = "world file '" + printable(path) + "': " + scene.fault;
  return scene;
}

}  // namespace ist
