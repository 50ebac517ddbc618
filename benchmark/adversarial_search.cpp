// Searches for queries that break a promise, or take much work: random ascent (hill climbing with
// restarts) over the mesh, the cloud, the poses and the motion of an adversarial case.
//
//   adversarial_search [--seconds N] [--seed S] [--keep FILE]
//   adversarial_search --replay GENOME
//   adversarial_search --moved-links SCENES [--seed S]
//
// For each promise it prints the largest violation found, in metres beyond what is allowed, and the
// genome that makes it. Work is counted in points measured against exact geometry and pairs of
// nodes and leaves, of a first query over a cloud of 4096 points, relative to the median of random
// cases.
// --keep appends the worst of each promise to a file, as test/support/adversarial_cases.txt holds
// them. --moved-links asks links that move among obstacles that stay, about eleven answers a scene
// (support/moved_links.h), and counts bounds above the truth.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "support/adversarial_case.h"
#include "support/meshes.h"
#include "support/moved_links.h"
#include "support/scene.h"
#include "support/truth_interval.h"

namespace ist {
namespace {

using test::Genome;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kWork = test::Violations::kCount;  // index of the objective beside promises
constexpr int kStalled = 300;  // a climb that found nothing better for so long starts anew
constexpr std::size_t kWorkPoints = 4096;

struct Options {
  double seconds = 60.0;
  std::uint64_t seed = 1;
  std::int64_t moved_links = 0;  // scenes; 0: none
  std::string keep, replay;
};

Genome random_genome(test::Rng* rng) {
  Genome genome(test::kGenomeSize);
  for (std::uint16_t& gene : genome) gene = static_cast<std::uint16_t>((*rng)());
  return genome;
}

// Changes one to four genes, by a little or altogether; most often not the mesh, since packing it
// takes longer than everything else.
Genome mutated(const Genome& from, test::Rng* rng) {
  Genome genome = from;
  const bool mesh = test::uniform(rng, 0, 1) < 0.2;
  const double low = mesh ? 0.0 : static_cast<double>(test::kMeshGenes);
  const double high = static_cast<double>(mesh ? test::kMeshGenes : test::kGenomeSize);
  const int count = 1 + static_cast<int>(test::uniform(rng, 0, 3.999));
  for (int i = 0; i < count; ++i) {
    std::uint16_t& gene = genome[static_cast<std::size_t>(test::uniform(rng, low, high - 1e-9))];
    const double size = std::pow(10.0, test::uniform(rng, -5, 0)) * 65535.0;
    const double value = gene + std::round(test::uniform(rng, -size, size) * 1.5);
    gene = static_cast<std::uint16_t>(std::clamp(value, 0.0, 65535.0));
  }
  return genome;
}

/// Decodes genomes; the model is packed again only where the mesh changed.
class Packed {
 public:
  std::shared_ptr<const RobotModel> model(const Genome& genome) {
    const Genome key(genome.begin(), genome.begin() + test::kMeshGenes);
    if (!model_ || key != key_) {
      model_ = test::adversarial_model(genome);
      key_ = key;
    }
    return model_;
  }

 private:
  Genome key_;
  std::shared_ptr<const RobotModel> model_;
};

// Points for the work of a query: on a sphere about the link, a plane, its own surface, or within
// it; nothing is as hard as points that are all equally far.
std::vector<Eigen::Vector3d> work_points(const Genome& genome, const test::AdversarialCase& c) {
  test::GeneReader genes(genome, test::kGenomeSize - 12);
  const std::size_t kind = genes.below(4);
  const double radius = genes.decades(-3.0, 0.0), noise = genes.decades(-9.0, -1.0);
  const Eigen::Vector3d middle = genes.vector(0.5);
  const auto& mesh = std::get<TriangleMesh>(c.link[0].shape);
  test::Rng rng(7);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < kWorkPoints; ++i) {
    const Eigen::Vector3d u = test::random_vector(&rng, 1.0).normalized();
    const std::size_t t = i % mesh.triangles.size();
    const double a = test::uniform(&rng, 0, 1), b = test::uniform(&rng, 0, 1 - a);
    const Eigen::Vector3d on =
        (1 - a - b) * mesh.corner(t, 0) + a * mesh.corner(t, 1) + b * mesh.corner(t, 2);
    const Eigen::Vector3d center = mesh.vertices[0] + middle;
    Eigen::Vector3d p = center + radius * u;
    if (kind == 1) p = center + radius * Eigen::Vector3d(u.x(), u.y(), 0.0);
    if (kind == 2) p = on + radius * u;
    if (kind == 3) p = test::bounds(mesh).center() + radius * (on - test::bounds(mesh).center());
    points.push_back(c.X_FL[0] * (p + noise * test::random_vector(&rng, 1.0)));
  }
  return points;
}

double work(const Genome& genome, const test::AdversarialCase& c) {
  const CloudSnapshot cloud = test::make_snapshot(work_points(genome, c));
  QueryConfig config = c.configs[0];
  config.tolerance = 0.001;
  config.max_distance = 1.0;
  ProximityQuery query(c.model, config);
  std::vector<LinkProximity> answers;
  query.run(std::vector<Eigen::Isometry3d>{c.X_FL[0], c.X_FL[0]}, {true, false}, {&cloud},
            &answers);
  const QueryStatistics& counts = query.statistics();
  // An exact evaluation takes about as long as fifty pairs.
  return static_cast<double>(counts.exact_evaluations) +
         0.02 * static_cast<double>(counts.node_pairs + counts.leaf_pairs);
}

using Scores = std::array<double, kWork + 1>;

Scores evaluate(const Genome& genome, Packed* packed, std::size_t objective) {
  const test::AdversarialCase c(genome, packed->model(genome));
  Scores scores;
  scores.fill(-std::numeric_limits<double>::infinity());
  if (objective == kWork) {
    scores[kWork] = work(genome, c);
  } else {
    const test::Violations found = test::judge(c);
    std::copy(found.excess.begin(), found.excess.end(), scores.begin());
  }
  return scores;
}

/// The worst case of each objective so far.
struct Worst {
  std::array<double, kWork + 1> score;
  std::array<Genome, kWork + 1> genome;
  std::uint64_t cases = 0, broken = 0;

  Worst() { score.fill(-std::numeric_limits<double>::infinity()); }
  void add(const Genome& from, const Scores& scores) {
    ++cases;
    bool any = false;
    for (std::size_t i = 0; i < scores.size(); ++i) {
      any = any || (i < kWork && scores[i] > 0.0);
      if (!(scores[i] > score[i])) continue;
      score[i] = scores[i];
      genome[i] = from;
    }
    broken += any ? 1 : 0;
  }
};

// Climbs from random genomes until the time is over.
void search(std::size_t objective, Clock::time_point until, test::Rng* rng, Worst* worst,
            std::vector<double>* first) {
  Packed packed;
  while (Clock::now() < until) {
    Genome best = random_genome(rng);
    Scores scores = evaluate(best, &packed, objective);
    double best_score = scores[objective];
    worst->add(best, scores);
    first->push_back(best_score);
    for (int stalled = 0; stalled < kStalled && Clock::now() < until; ++stalled) {
      const Genome genome = mutated(best, rng);
      scores = evaluate(genome, &packed, objective);
      worst->add(genome, scores);
      if (scores[objective] < best_score) continue;
      if (scores[objective] > best_score) stalled = 0;
      best = genome;
      best_score = scores[objective];
    }
  }
}

const char* objective_name(std::size_t i) {
  return i == kWork ? "work" : test::Violations::kNames[i];
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void print(const Worst& worst, const std::vector<double>& first_work) {
  std::printf("%llu cases, %llu break a promise\n\n", static_cast<unsigned long long>(worst.cases),
              static_cast<unsigned long long>(worst.broken));
  std::printf("| promise | most beyond what is allowed |\n|---|---:|\n");
  for (std::size_t i = 0; i < kWork; ++i) {
    if (i == 6) {
      std::printf("| %s | %.3g of the gain |\n", objective_name(i), worst.score[i]);
    } else {
      std::printf("| %s | %.3g um |\n", objective_name(i), 1e6 * worst.score[i]);
    }
  }
  const double ordinary = median(first_work);
  std::printf("| work | %.0f, %.1f times the median %.0f |\n\n", worst.score[kWork],
              worst.score[kWork] / std::max(1.0, ordinary), ordinary);
  for (std::size_t i = 0; i <= kWork; ++i) {
    std::printf("%s %s\n", objective_name(i), test::to_text(worst.genome[i]).c_str());
  }
}

void keep(const Worst& worst, const std::string& path) {
  std::ofstream file(path, std::ios::app);
  for (std::size_t i = 0; i <= kWork; ++i) {
    if (worst.genome[i].empty()) continue;
    file << objective_name(i) << " " << test::to_text(worst.genome[i]) << "\n";
  }
}

int replay(const std::string& text) {
  const Genome genome = test::genome_from(text);
  const test::AdversarialCase c(genome, nullptr);
  const test::Violations found = test::judge(c);
  for (std::size_t i = 0; i < kWork; ++i) {
    std::printf("%-10s %.9g\n", objective_name(i), found.excess[i]);
  }
  std::printf("%-10s %.0f\n", "work", work(genome, c));
  const auto& mesh = std::get<TriangleMesh>(c.link[0].shape);
  std::printf("mesh: %zu triangles, %g x %g x %g m; %zu points\n", mesh.triangles.size(),
              test::bounds(mesh).sizes().x(), test::bounds(mesh).sizes().y(),
              test::bounds(mesh).sizes().z(), c.points_F.size());
  for (std::size_t t = 0; t < mesh.triangles.size() && t < 40; ++t) {
    for (int k = 0; k < 3; ++k) {
      std::printf("%s(%.9g %.9g %.9g)", k == 0 ? "  " : " ", mesh.corner(t, k).x(),
                  mesh.corner(t, k).y(), mesh.corner(t, k).z());
    }
    std::printf("\n");
  }
  ProximityQuery query(c.model, {});
  std::vector<LinkProximity> answers;
  for (std::size_t step = 0; step < c.X_FL.size(); ++step) {
    query.set_config(c.configs[step]);
    query.run(std::vector<Eigen::Isometry3d>{c.X_FL[step], c.X_FL[step]}, {true, false}, {&c.cloud},
              &answers);
    const test::TruthInterval truth = test::truth_interval(c.link, c.X_FL[step], c.points_F);
    std::printf(
        "step %zu: state %d, bound %.12g, distance %.12g, truth %.12g to %.12g, tolerance %g\n",
        step, static_cast<int>(answers[0].state), answers[0].lower_bound, answers[0].distance,
        truth.low, truth.high, c.configs[step].tolerance);
  }
  SelfQuery self(c.model, {{0, 1}}, c.configs[0]);
  std::vector<PairProximity> pairs;
  self.run(std::vector<Eigen::Isometry3d>{c.X_FL[0], c.X_FL[0] * c.X_LB}, {true, true}, &pairs);
  std::printf("pair: state %d, bound %.12g, distance %.12g, max_distance %g\n",
              static_cast<int>(pairs[0].state), pairs[0].lower_bound, pairs[0].distance,
              c.configs[0].max_distance);
  for (const LinkModel& link : c.model->links) {
    const PackingCertificate& certificate = link.packing.certificate;
    std::printf("%s: %zu spheres, max_gap %g, interior_gap %g, closed %d\n", link.name.c_str(),
                link.packing.spheres.size(), certificate.max_gap, certificate.interior_gap,
                static_cast<int>(link.solid.is_closed()));
  }
  return 0;
}

int ask_moved_links(const Options& options) {
  const test::MovedLinksReport report = test::search_moved_links(options.seed, options.moved_links);
  std::printf("%lld answers, %lld bounds above the truth, by %.3g m at most (scene %llu)\n",
              static_cast<long long>(report.answers), static_cast<long long>(report.wrong_bounds),
              report.bound_excess, static_cast<unsigned long long>(report.worst_seed));
  std::printf("distances off by %.3g m, intervals wider than the tolerance by %.3g m at most\n",
              report.distance_excess, report.width_excess);
  return report.wrong_bounds == 0 ? 0 : 1;
}

int run(const Options& options) {
  if (options.moved_links > 0) return ask_moved_links(options);
  if (!options.replay.empty()) return replay(options.replay);
  Worst worst;
  std::vector<double> first_work, unused;
  test::Rng rng(options.seed);
  const double each = options.seconds / static_cast<double>(kWork + 1);
  for (std::size_t i = 0; i <= kWork; ++i) {
    const auto until = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                          std::chrono::duration<double>(each));
    search(i, until, &rng, &worst, i == kWork ? &first_work : &unused);
    std::fprintf(stderr, "%s: %.3g after %llu cases\n", objective_name(i), worst.score[i],
                 static_cast<unsigned long long>(worst.cases));
  }
  print(worst, first_work);
  if (!options.keep.empty()) keep(worst, options.keep);
  return 0;
}

}  // namespace
}  // namespace ist

int main(int argc, char** argv) {
  ist::Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--seconds") options.seconds = std::atof(value.c_str());
    if (name == "--seed") options.seed = std::strtoull(value.c_str(), nullptr, 10);
    if (name == "--moved-links") options.moved_links = std::atoll(value.c_str());
    if (name == "--keep") options.keep = value;
    if (name == "--replay") options.replay = value;
  }
  return ist::run(options);
}
