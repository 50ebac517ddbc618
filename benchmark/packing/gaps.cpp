// Gaps and filled volume by number of spheres, in the three orders.

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <string>

#include "internal/packing/packer.h"
#include "internal/packing/packing_report.h"
#include "packing/options.h"
#include "packing/parallel.h"

namespace ist::benchmark {
namespace {

constexpr int kCounts[] = {200, 1000, 5000, 20000};
constexpr PackingOrder kOrders[] = {PackingOrder::kMedial, PackingOrder::kDisjoint,
                                    PackingOrder::kVolume};
constexpr std::size_t kOrderCount = std::size(kOrders);

// The design's goals: sampled gaps of a prototype on one link.
struct Prototype {
  int spheres;
  const char *medial, *disjoint, *volume;  // [mm] gap, largest / mean
};
constexpr const char* kPrototype = "prototype, one link, sampled";
constexpr Prototype kPrototypes[] = {{200, "6.3 / 1.74", "8.4 / 2.91", "9.7 / 2.94"},
                                     {1000, "1.8 / 0.47", "4.1 / 1.42", "5.3 / 1.56"},
                                     {5000, "0.72 / 0.10", "2.1 / 0.67", "2.8 / 0.80"}};

struct Job {
  const PandaLink* link;
  int spheres;
};

// Returns the cells "largest / mean" and "filled".
std::pair<std::string, std::string> measured(const PandaLink& link, int spheres,
                                             PackingOrder order) {
  PackingConfig config;
  config.max_error = 1e-5;  // [m] never reached: the number of spheres decides
  config.max_spheres = spheres;
  config.order = order;
  const Packing packing = pack_mesh(link.mesh, config);
  const Solid solid({{link.mesh, Eigen::Isometry3d::Identity(), ""}});
  const PackingReport report = measure_packing(solid, packing.spheres);
  return {gaps(packing.certificate.max_gap, packing.certificate.mean_gap),
          text("%.1f", 100.0 * report.filled_volume / report.solid_volume)};
}

}  // namespace

Table gaps_table() {
  Table table("gaps",
              {"spheres", "link", "medial: gap, largest / mean [mm]", "filled [%]",
               "disjoint: gap [mm]", "filled [%]", "volume: gap [mm]", "filled [%]"},
              2);
  for (const int spheres : kCounts) {
    table.place({std::to_string(spheres), kPrototype});
    for (const std::string& link : panda_names()) table.place({std::to_string(spheres), link});
  }
  return table;
}

bool measure_gaps(const Options& options, Table* table) {
  const std::vector<PandaLink> links = panda_links(options);
  if (links.empty()) return false;
  for (const Prototype& one : kPrototypes) {
    table->add({std::to_string(one.spheres), kPrototype, one.medial, "", one.disjoint, "",
                one.volume, ""});
  }
  std::vector<Job> jobs;  // the longest first
  for (std::size_t c = std::size(kCounts); c-- > 0;) {
    const int spheres = kCounts[c];
    if (!options.spheres.empty() &&
        std::count(options.spheres.begin(), options.spheres.end(), spheres) == 0) {
      continue;
    }
    for (const PandaLink& link : links) jobs.push_back({&link, spheres});
  }
  std::vector<Table::Row> rows;
  for (const Job& job : jobs) rows.push_back({std::to_string(job.spheres), job.link->name});
  std::vector<std::pair<std::string, std::string>> cells(jobs.size() * kOrderCount);
  std::mutex printing;
  parallel_for(cells.size(), options.threads, [&](std::size_t i) {
    const Job& job = jobs[i / kOrderCount];
    cells[i] = measured(*job.link, job.spheres, kOrders[i % kOrderCount]);
    const std::lock_guard<std::mutex> lock(printing);
    std::fprintf(stderr, "%s, %d spheres, order %zu: %s mm, %s %%\n", job.link->name.c_str(),
                 job.spheres, i % kOrderCount, cells[i].first.c_str(), cells[i].second.c_str());
  });
  for (std::size_t i = 0; i < cells.size(); ++i) {
    rows[i / kOrderCount].push_back(cells[i].first);
    rows[i / kOrderCount].push_back(cells[i].second);
  }
  for (const Table::Row& row : rows) table->add(row);
  return true;
}

}  // namespace ist::benchmark
