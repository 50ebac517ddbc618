// Searches for queries that break a promise: random ascent (hill climbing with restarts) over the
// mesh, the cloud, the poses and the motion of an adversarial case.
//
// For each promise it prints the largest violation found, in metres beyond what is allowed, and the
// genome that makes it; --replay prints the violations of a genome.
// --keep appends the worst of each promise to a file, as test/support/adversarial_cases.txt holds
// them. --moved-links asks links that move among obstacles that stay, about eleven answers a scene
// (support/moved_links.h), and counts bounds above the truth.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "support.h"
#include "support/adversarial_case.h"
#include "support/moved_links.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::Genome;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kPromises = test::Violations::kCount;
constexpr int kStalled = 300;  // a climb that found nothing better for so long starts anew

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

/// The worst case of each promise so far.
struct Worst {
  test::Violations found;
  std::array<Genome, kPromises> genome;
  std::uint64_t cases = 0, broken = 0;

  void add(const Genome& from, const test::Violations& violations) {
    ++cases;
    bool any = false;
    for (std::size_t i = 0; i < kPromises; ++i) {
      any = any || violations.excess[i] > 0.0;
      if (!(violations.excess[i] > found.excess[i])) continue;
      found.excess[i] = violations.excess[i];
      genome[i] = from;
    }
    broken += any ? 1 : 0;
  }
};

// Climbs from random genomes until the time is over.
void search(std::size_t promise, Clock::time_point until, test::Rng* rng, Worst* worst) {
  Packed packed;
  const auto judge = [&](const Genome& genome) {
    const test::Violations found = test::judge({genome, packed.model(genome)});
    worst->add(genome, found);
    return found.excess[promise];
  };
  while (Clock::now() < until) {
    Genome best = random_genome(rng);
    double best_score = judge(best);
    for (int stalled = 0; stalled < kStalled && Clock::now() < until; ++stalled) {
      const Genome genome = mutated(best, rng);
      const double score = judge(genome);
      if (score < best_score) continue;
      if (score > best_score) stalled = 0;
      best = genome;
      best_score = score;
    }
  }
}

void print(const Worst& worst) {
  std::printf("%llu cases, %llu break a promise\n\n", static_cast<unsigned long long>(worst.cases),
              static_cast<unsigned long long>(worst.broken));
  std::printf(
      "| promise | most beyond what is allowed [m, of the gain] | genome |\n|---|---:|---|\n");
  for (std::size_t i = 0; i < kPromises; ++i) {
    std::printf("| %s | %.3g | %s |\n", test::Violations::kNames[i], worst.found.excess[i],
                test::to_text(worst.genome[i]).c_str());
  }
}

void keep(const Worst& worst, const std::string& path) {
  std::ofstream file(path, std::ios::app);
  for (std::size_t i = 0; i < kPromises; ++i) {
    if (worst.genome[i].empty()) continue;
    file << test::Violations::kNames[i] << " " << test::to_text(worst.genome[i]) << "\n";
  }
}

int replay(const std::string& text) {
  const test::Violations found =
      test::judge(test::AdversarialCase(test::genome_from(text), nullptr));
  for (std::size_t i = 0; i < kPromises; ++i) {
    std::printf("%-10s %.9g\n", test::Violations::kNames[i], found.excess[i]);
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
  test::Rng rng(options.seed);
  const std::chrono::duration<double> each(options.seconds / static_cast<double>(kPromises));
  for (std::size_t i = 0; i < kPromises; ++i) {
    search(i, Clock::now() + std::chrono::duration_cast<Clock::duration>(each), &rng, &worst);
  }
  print(worst);
  if (!options.keep.empty()) keep(worst, options.keep);
  return 0;
}

}  // namespace
}  // namespace ist

int main(int argc, char** argv) {
  ist::Options options;
  CLI::App line("Searches for queries that break a promise.");
  line.add_option("--seconds", options.seconds, "How long to search");
  line.add_option("--seed", options.seed, "Of the search");
  line.add_option("--keep", options.keep, "File to which the worst of each promise is appended");
  line.add_option("--replay", options.replay, "A genome whose violations are printed");
  line.add_option("--moved-links", options.moved_links, "Scenes of links that move");
  CLI11_PARSE(line, argc, argv);
  return ist::run(options);
}
