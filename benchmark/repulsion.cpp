// Smoothness of the repulsion along motions, its cost, and its dependence on the number of points,
// compared with the nearest pair and with exact geometry: tables for doc/repulsion.md.
//
// Usage: repulsion CACHE_FOLDER [DOCUMENT]; scripts/benchmark --repulsion calls it. The recorded
// scenes need the test data: IST_PROXIMITY_DATA, or ../shared/data.

#include <cstdio>
#include <string>
#include <vector>

#include "document.h"
#include "repulsion/measure.h"
#include "repulsion/scene.h"
#include "support.h"
#include "support/data_dir.h"

namespace {

using ist::benchmark::Measured;
using ist::benchmark::Noise;
using ist::benchmark::quantile;

// The resolutions: max_error [m] of the packing for distances, and spheres of the disjoint one.
struct Resolution {
  double max_error;
  std::size_t spheres;
};
constexpr Resolution kResolutions[] = {{0.02, 125}, {0.01, 250}, {0.005, 500}};

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

std::string row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + cell + " |";
  return line + "\n";
}

std::string head(const std::vector<std::string>& cells) {
  std::string rule = "|";
  for (std::size_t i = 0; i < cells.size(); ++i) rule += "---|";
  return row(cells) + rule + "\n";
}

std::vector<std::string> noise_cells(const Noise& noise, double reference) {
  const auto angle = [](const std::vector<double>& values, double q) {
    return values.empty() ? std::string() : text("%.2f", quantile(values, q));
  };
  const auto length = [](const std::vector<double>& values) {
    return values.empty() ? std::string() : text("%.2f", 100.0 * quantile(values, 1.0));
  };
  return {std::to_string(noise.angles.size()),
          angle(noise.free_angles, 0.999),
          angle(noise.free_angles, 1.0),
          length(noise.free_lengths),
          angle(noise.angles, 0.999),
          angle(noise.angles, 1.0),
          length(noise.lengths),
          reference > 0.0 ? text("%.2f", noise.variation / reference) : "",
          text("%.1f", 100.0 * static_cast<double>(noise.short_steps) /
                           static_cast<double>(noise.short_steps + noise.angles.size() + 1))};
}

struct Tables {
  std::string smoothness =
      head({"scene", "max_error [mm]", "vector", "steps", "no contact: angle p99.9 [°]",
            "largest [°]", "length, largest [%]", "all: angle p99.9 [°]", "largest [°]",
            "length, largest [%]", "variation / exact", "too short [%]"});
  std::string cost = head({"scene", "max_error [mm]", "query, median / p99 [us]",
                           "blend, median / p99 [us]", "ratio of medians", "ratio of p99"});
  std::string density = head({"scene", "smoothing [mm]", "half: median [%]", "p99 [%]",
                              "largest [%]", "twice: median [%]", "p99 [%]", "largest [%]"});

  void add(const std::string& scene, double max_error, const Measured& measured) {
    const std::string resolution = text("%g", 1e3 * max_error);
    const auto add_row = [&](const char* name, const Noise& noise, double reference) {
      std::vector<std::string> cells = {scene, resolution, name};
      for (const std::string& cell : noise_cells(noise, reference)) cells.push_back(cell);
      smoothness += row(cells);
    };
    add_row("nearest pair", measured.nearest, measured.reference_variation);
    add_row("blend, 50 mm", measured.narrow, measured.reference_variation);
    add_row("blend", measured.blend, measured.reference_variation);
    if (!measured.wrench.lengths.empty()) {
      add_row("wrench", measured.wrench, measured.wrench_reference_variation);
    }
    const auto times = [](const std::vector<double>& us) {
      return text("%.1f", quantile(us, 0.5)) + " / " + text("%.1f", quantile(us, 0.99));
    };
    const auto ratio = [&measured](double q) {
      return text("%.2f", quantile(measured.blend_us, q) / quantile(measured.query_us, q));
    };
    cost += row({scene, resolution, times(measured.query_us), times(measured.blend_us), ratio(0.5),
                 ratio(0.99)});
    if (max_error != kResolutions[2].max_error) return;
    add_density(scene, "50", measured.narrow_half, measured.narrow_twice);
    add_density(scene, "100", measured.half, measured.twice);
  }

  void add_density(const std::string& scene, const std::string& smoothing,
                   const std::vector<double>& half, const std::vector<double>& twice) {
    std::vector<std::string> cells = {scene, smoothing};
    for (const std::vector<double>* change : {&half, &twice}) {
      for (const double q : {0.5, 0.99, 1.0}) {
        cells.push_back(text("%.2f", 100.0 * quantile(*change, q)));
      }
    }
    density += row(cells);
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: repulsion CACHE_FOLDER [DOCUMENT]\n");
    return 1;
  }
  Tables tables;
  const auto measure = [&](const std::vector<ist::benchmark::MovingScene>& scenes) {
    for (const ist::benchmark::MovingScene& scene : scenes) {
      for (const Resolution& resolution : kResolutions) {
        std::fprintf(stderr, "%s, packed to %g mm: %zu steps\n", scene.name.c_str(),
                     1e3 * resolution.max_error, scene.steps.size());
        const auto model = ist::benchmark::pack(scene.robot, resolution.max_error, argv[1]);
        tables.add(scene.name, resolution.max_error,
                   ist::benchmark::measure(scene, model,
                                           ist::benchmark::pack_disjoint(
                                               scene.robot, *model, resolution.spheres, argv[1])));
      }
    }
  };
  measure(ist::benchmark::analytic_scenes());
  if (const auto data = ist::test::data_dir()) {
    measure(ist::benchmark::recorded_scenes(*data));
  } else {
    std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
  }
  std::printf("%s\n%s\n%s", tables.smoothness.c_str(), tables.cost.c_str(), tables.density.c_str());
  if (argc < 3) return 0;
  const bool written = ist::benchmark::write_table(argv[2], "smoothness", tables.smoothness) &&
                       ist::benchmark::write_table(argv[2], "cost", tables.cost) &&
                       ist::benchmark::write_table(argv[2], "density", tables.density);
  return written ? 0 : 1;
}
