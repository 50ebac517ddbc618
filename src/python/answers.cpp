#include "answers.h"

#include <cstdint>

namespace ist::python {
namespace {

/// @param at  at(k) is answer k
template <class At>
Distances arrays_of(const Shape& shape, const At& at) {
  Distances arrays;
  arrays.state = make_array<std::uint8_t>(
      shape, [&](std::size_t k) { return static_cast<std::uint8_t>(at(k).state); });
  arrays.distance = make_array<double>(shape, [&](std::size_t k) { return at(k).distance; });
  arrays.lower_bound = make_array<double>(shape, [&](std::size_t k) { return at(k).lower_bound; });
  arrays.point = make_array<std::int64_t>(shape, [&](std::size_t k) {
    return at(k).source < 0 ? std::int64_t{-1} : static_cast<std::int64_t>(at(k).point);
  });
  arrays.p_FCl = make_vectors(shape, [&](std::size_t k) { return at(k).p_FCl; });
  arrays.p_LCl = make_vectors(shape, [&](std::size_t k) { return at(k).p_LCl; });
  arrays.p_FCo = make_vectors(shape, [&](std::size_t k) { return at(k).p_FCo; });
  arrays.direction = make_vectors(shape, [&](std::size_t k) { return at(k).direction; });
  return arrays;
}

constexpr const char* kState = "UNKNOWN, CLEAR, NEAR or CONTACT (uint8)";
constexpr const char* kDistance =
    "[m] signed distance to the nearest point found, an upper bound; inf when CLEAR, nan when "
    "UNKNOWN";
constexpr const char* kLowerBound =
    "[m] proven: the true distance is never below it; max_distance when CLEAR, -inf when UNKNOWN";
constexpr const char* kPoint = "index of the nearest point in the array of points; -1 when none";
constexpr const char* kOnLink = "[m] closest point on the link, in the root link's frame";
constexpr const char* kOnLinkLocal = "[m] the same in the link's own frame";
constexpr const char* kOnObstacle = "[m] closest point on the obstacle, in the root link's frame";
constexpr const char* kDirection =
    "unit vector along which the link moves away: point_on_link - point_on_obstacle = distance * "
    "direction";

/// Defines the members that both classes have.
template <class Class, class Get>
void define_members(py::class_<Class>* type, const Get& get) {
  const auto member = [&](const char* name, py::object Distances::*array, const char* doc) {
    type->def_property_readonly(
        name, [get, array](const Class& answer) { return get(answer).*array; }, doc);
  };
  member("state", &Distances::state, kState);
  member("distance", &Distances::distance, kDistance);
  member("lower_bound", &Distances::lower_bound, kLowerBound);
  member("point", &Distances::point, kPoint);
  member("point_on_link", &Distances::p_FCl, kOnLink);
  member("point_on_link_local", &Distances::p_LCl, kOnLinkLocal);
  member("point_on_obstacle", &Distances::p_FCo, kOnObstacle);
  member("direction", &Distances::direction, kDirection);
}

}  // namespace

Distances to_arrays(const std::vector<LinkProximity>& answers, const Shape& shape) {
  return arrays_of(shape, [&](std::size_t k) -> const LinkProximity& { return answers[k]; });
}

Nearest to_arrays(const std::vector<RobotProximity>& answers, const Shape& shape) {
  Nearest arrays;
  arrays.link = make_array<std::int32_t>(shape, [&](std::size_t k) { return answers[k].link; });
  arrays.all_known = make_array<bool>(shape, [&](std::size_t k) { return answers[k].all_known; });
  arrays.answer =
      arrays_of(shape, [&](std::size_t k) -> const LinkProximity& { return answers[k].nearest; });
  return arrays;
}

void define_answers(py::module_* module) {
  const auto constant = [&](const char* name, LinkState state) {
    module->attr(name) = static_cast<int>(state);
  };
  constant("UNKNOWN", LinkState::kUnknown);
  constant("CLEAR", LinkState::kClear);
  constant("NEAR", LinkState::kNear);
  constant("CONTACT", LinkState::kContact);

  py::class_<Distances> distances(*module, "Distances",
                                  "Answers of all links. For one configuration each array has the "
                                  "shape (links,), for n of them "
                                  "(n, links); points and vectors have a last dimension of 3.");
  define_members(&distances, [](const Distances& answer) -> const Distances& { return answer; });

  py::class_<Nearest> nearest(
      *module, "Nearest",
      "The nearest link. For one configuration each member is a scalar, for n of them an array of "
      "shape (n,); points and vectors have a last dimension of 3. The lower bound is proven for "
      "every link, and -inf where one is not known.");
  define_members(&nearest, [](const Nearest& answer) -> const Distances& { return answer.answer; });
  nearest
      .def_property_readonly(
          "link", [](const Nearest& answer) { return answer.link; },
          "index of the nearest link in Robot.links; -1 when CLEAR or UNKNOWN")
      .def_property_readonly(
          "all_known", [](const Nearest& answer) { return answer.all_known; },
          "False where links without pose or geometry were left out");
}

}  // namespace ist::python
