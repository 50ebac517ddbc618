#include "proximity/opening_search.h"

#include <array>
#include <cmath>

#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr std::size_t kOpeningCapacity = 512;
// [m] Openings that are farther are not looked at again before the links have moved by that much.
constexpr double kFarEnough = 0.02;
// Spheres that may be tested near openings, and pairs of boxes looked at, at one pose.
constexpr int kMaxTests = 2000, kMaxSteps = 50000;
// [m] Parts of a surface are divided no farther.
constexpr double kSmallest = 1e-6;
// [m] Where surfaces are near openings, they are tested with this much slack, so that the answer
// holds for a while.
constexpr double kSlack = 2e-3;

// Decides for the part of a surface that is in a cell whether it is inside.
class CellVisitor : public SurfacePairSearch::Visitor {
 public:
  /// @param slack  [m] no point may be inside, wherever it is moved by that much
  CellVisitor(const Openings& openings, const Eigen::Isometry3d& X_AB, double slack)
      : openings_(openings), X_AB_(X_AB), slack_(slack) {}

  bool visit(const ConvexPart& cell_B, const ConvexPart& part_B) override {
    if (part_B.kind != ConvexPart::Kind::kTriangle) {
      const double size = part_B.kind == ConvexPart::Kind::kSphere ? 0.0 : part_B.b.norm();
      return test(cell_B, part_B.a, std::hypot(part_B.radius, size)) == Openings::Side::kOutside;
    }
    return visit_triangle(cell_B, {part_B.a, part_B.b, part_B.c});
  }

  bool found_inside() const { return found_inside_; }
  const Eigen::Vector3d& inside_B() const { return inside_B_; }

 private:
  using Triangle = std::array<Eigen::Vector3d, 3>;

  Openings::Side test(const ConvexPart& cell_B, const Eigen::Vector3d& center_B, double radius) {
    ++tests_;
    const Openings::Side side = openings_.side(cell_B.number, X_AB_ * center_B, radius + slack_);
    if (side == Openings::Side::kInside) {
      found_inside_ = true;
      inside_B_ = center_B;
    }
    return side;
  }

  // Halves the triangle at its longest edge until each piece is off the cell or on one side.
  bool visit_triangle(const ConvexPart& cell_B, const Triangle& whole) {
    std::array<Triangle, 64> stack;  // more would be smaller than kSmallest
    std::size_t size = 0;
    stack[size++] = whole;
    while (size > 0) {
      const Triangle t = stack[--size];
      const Eigen::Vector3d nearest = closest_point_on_triangle(cell_B.a, t[0], t[1], t[2]);
      if ((nearest - cell_B.a).norm() > (cell_B.radius + slack_) * (1.0 + 1e-9) + 1e-12) continue;
      const Eigen::Vector3d center = (t[0] + t[1] + t[2]) / 3.0;
      double radius = 0.0, longest = -1.0;
      std::size_t first = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        radius = std::max(radius, (t[k] - center).norm());
        const double length = (t[(k + 1) % 3] - t[k]).norm();
        if (length > longest) {
          longest = length;
          first = k;
        }
      }
      const Openings::Side side = test(cell_B, center, radius * (1.0 + 1e-9));
      if (side == Openings::Side::kOutside) continue;
      const bool is_over = side == Openings::Side::kInside || tests_ >= kMaxTests ||
                           radius < kSmallest + 0.1 * slack_ || size + 2 > stack.size();
      if (is_over) return false;
      const std::size_t second = (first + 1) % 3, apex = (first + 2) % 3;
      const Eigen::Vector3d middle = 0.5 * (t[first] + t[second]);
      stack[size++] = {t[first], middle, t[apex]};
      stack[size++] = {middle, t[second], t[apex]};
    }
    return true;
  }

  const Openings& openings_;
  const Eigen::Isometry3d& X_AB_;
  const double slack_;
  int tests_ = 0;
  bool found_inside_ = false;
  Eigen::Vector3d inside_B_ = Eigen::Vector3d::Zero();
};

}  // namespace

OpeningSearch::OpeningSearch(const LinkSurface& a, const LinkSurface& b, OpeningSearch* memory)
    : a_(a),
      is_closed_(a.opening_cells.empty()),
      search_(a.opening_cells, b.surface, is_closed_ ? 2 * SurfaceBvh::kWidth : kOpeningCapacity,
              memory != nullptr ? &memory->search_ : nullptr),
      moved_(kInfinity) {
  if (is_closed_) clearance_ = kInfinity;
}

void OpeningSearch::note_motion(double displacement) {
  if (is_closed_) return;
  moved_ += displacement;
  clearance_ -= displacement;
  if (!(clearance_ > 0.0)) clearance_ = 0.0;
}

OpeningSearch::Answer OpeningSearch::decide(const Eigen::Isometry3d& X_BA, int* steps) {
  if (is_closed_ || stays_apart()) return Answer::kApart;
  search_.move_to(X_BA, moved_);
  int left = kMaxSteps;
  SurfacePairSearch::Goal goal;
  goal.range = kFarEnough;
  goal.tolerance = 0.5 * kFarEnough;
  const bool is_found = search_.run(goal, &left);
  if (search_.is_at_reference()) moved_ = 0.0;
  Answer answer = Answer::kUnknown;
  if (is_found && search_.lower_bound() > 0.0) {
    clearance_ = search_.lower_bound();
    answer = Answer::kApart;
  } else {
    const Eigen::Isometry3d X_AB = X_BA.inverse();
    for (const double slack : {kSlack, 0.0}) {
      CellVisitor visitor(a_.openings, X_AB, slack);
      const bool all_outside = search_.visit_near(slack, &visitor, &left);
      if (visitor.found_inside()) {
        answer = Answer::kInside;
        inside_B_ = visitor.inside_B();
      }
      if (!all_outside && !visitor.found_inside()) continue;
      if (all_outside) answer = Answer::kApart;
      clearance_ = all_outside ? slack : 0.0;
      break;
    }
  }
  *steps -= kMaxSteps - left;
  return answer;
}

}  // namespace ist
