#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstddef>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"

namespace ist {

/// A bound of a nearest velocity that holds it back.
struct ActiveBound {
  enum class Kind { kApproach, kSweep, kUpper, kLower } kind;
  Eigen::Index index;  ///< of the row, or of the joint
};

/// The velocity nearest to a target under ConstraintRows and limits by joint: a strictly convex
/// quadratic program.
///
/// It is the dual active-set method of Goldfarb and Idnani (1983), which begins at the target and
/// takes in the bound that is violated most, until none is. Of the 2^n linear inequalities that one
/// bound sweep * |x| <= limit stands for, only the one that x violates most is ever written down;
/// that is why it is not a library's solver. Nothing is allocated after construction.
class NearestVelocity {
 public:
  enum class Outcome { kFound, kContradiction, kOutOfTime };

  explicit NearestVelocity(Eigen::Index joints);

  /// @param rows    complete, one column for each joint
  /// @param lower, upper, weights  by joint; weights > 0
  /// @param x       overwritten where kFound
  Outcome solve(const ConstraintRows& rows, const Eigen::VectorXd& lower,
                const Eigen::VectorXd& upper, const Eigen::VectorXd& weights,
                const Eigen::VectorXd& target, std::chrono::steady_clock::time_point end,
                Eigen::VectorXd* x);

  /// The bounds that hold back the last solution, or contradicted one another. There are no more
  /// than joints, and one more in a contradiction.
  const std::vector<ActiveBound>& active() const { return active_; }
  int iterations() const { return iterations_; }  ///< of the last solve()

 private:
  struct Bound {
    ActiveBound what;
    double violation;  ///< in units of the scaled velocity; <= 0: met
  };

  Bound most_violated() const;
  double scaled_norm(const ConstraintRows::Matrix& rows, Eigen::Index row) const;
  void take_normal(const ActiveBound& bound);
  void push(const ActiveBound& bound, double multiplier);
  void drop(Eigen::Index position);
  void orthonormalize(Eigen::Index position);
  bool take_in(const ActiveBound& bound);

  // The problem, valid during solve().
  const ConstraintRows* rows_ = nullptr;
  const Eigen::VectorXd *lower_ = nullptr, *upper_ = nullptr;
  Eigen::VectorXd scale_;          ///< by joint: y = scale x has unit weights
  Eigen::VectorXd x_, speed_, y_;  ///< the present velocity, its magnitudes, and scaled

  // Active bounds, by position: normals N = Q R of unit length and multipliers.
  std::vector<ActiveBound> active_;
  Eigen::Index count_ = 0;
  Eigen::MatrixXd N_, Q_, R_;
  Eigen::VectorXd multipliers_;
  // The bound that is taken in: normal * y <= limit.
  Eigen::VectorXd normal_, step_, along_, rates_;
  double limit_ = 0.0;
  int iterations_ = 0;
};

}  // namespace ist
