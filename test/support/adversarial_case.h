#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_model.h"

/// A query that is made of parameters, and by how much each promise of its answers is broken. The
/// benchmark `adversarial_search` climbs over the parameters; the worst that it finds are kept in
/// adversarial_cases.txt.
namespace ist::test {

/// The parameters of a case, each from 0 to 65535. Small changes are small changes of the case.
using Genome = std::vector<std::uint16_t>;

constexpr std::size_t kMeshGenes = 24;    ///< the first genes decide the link alone
constexpr std::size_t kGenomeSize = 140;  ///< all genes
constexpr int kSteps = 3;                 ///< poses one after the other

std::string to_text(const Genome& genome);

Genome genome_from(const std::string& text);

/// Takes values from a genome, front to back; zeros after its end.
class GeneReader {
 public:
  explicit GeneReader(const Genome& genome, std::size_t first = 0);

  /// 0 to 1.
  double fraction();
  std::size_t below(std::size_t n);
  double between(double low, double high) { return low + (high - low) * fraction(); }
  /// A power of ten.
  double decades(double low, double high);
  Eigen::Vector3d vector(double size);
  Eigen::Isometry3d pose(double angle, double size);

 private:
  const Genome& genome_;
  std::size_t next_;
};

/// The link: prisms, slivers, shells, boxes, meshes with holes, from 10 um to 1 m, posed anyhow.
TriangleMesh mesh_of(const Genome& genome);

std::shared_ptr<const RobotModel> adversarial_model(const Genome& genome);

/// By how much an answer breaks what is promised; not above 0 where everything holds. [m], except
/// for repulsion, which is a ratio.
struct Violations {
  static constexpr std::size_t kCount = 7;
  static constexpr std::array<const char*, kCount> kNames = {
      "bound", "distance", "width", "depth", "state", "self-query", "repulsion"};
  std::array<double, kCount> excess;

  Violations();
  void add(std::size_t promise, double value);
};

/// Everything that a genome stands for.
struct AdversarialCase {
  LinkGeometry link;
  std::shared_ptr<const RobotModel> model;
  std::vector<Eigen::Vector3d> points_F;
  CloudSnapshot cloud;
  std::vector<Eigen::Isometry3d> X_FL;  ///< by step
  Eigen::Isometry3d X_LB;               ///< the other link of the self-query in the first
  std::vector<QueryConfig> configs;     ///< by step
  RepulsionConfig repulsion;

  /// @param packed  of the same mesh genes, or null
  AdversarialCase(const Genome& genome, std::shared_ptr<const RobotModel> packed);

  static Eigen::Vector3d point(const TriangleMesh& mesh, GeneReader* genes);
};

/// Runs the queries of a case and compares them with brute force in double.
Violations judge(const AdversarialCase& c);

}  // namespace ist::test
