// doc/accuracy.md states limits of every mode's error and of every hard case. This test measures
// the errors again: they must stay below the limits, and it must measure every row.
//
// IST_PROXIMITY_UPDATE_DOC=1 writes the tables, with the 2 mm packing of the robot as well.

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <set>
#include <string>

#include "support/accuracy.h"
#include "support/data_dir.h"
#include "support/hard_scenes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/trial.h"
#include "support/truth.h"

namespace ist {
namespace {

const std::string kDocument = std::string(IST_PROXIMITY_SOURCE_DIR) + "/doc/accuracy.md";
constexpr double kTolerances[] = {0.001, 0.0, 0.005};
constexpr double kMillimetre = 1e-3;
constexpr double kRounding = 2e-8;       // [m] of float, which decides about sides of a surface
constexpr double kTruthRounding = 1e-6;  // [m] poses and points of the data are float32

bool updating() { return std::getenv("IST_PROXIMITY_UPDATE_DOC") != nullptr; }

using test::Measured;

std::string mode(const std::string& scene, double max_error, double tolerance) {
  return scene + " | " + test::number(max_error / kMillimetre) + " | " +
         test::number(tolerance / kMillimetre);
}

void measure_synthetic(Measured* measured) {
  test::Rng rng(95);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  for (const double max_error : {0.005, 0.002}) {
    const auto model = test::model_of(links, max_error);
    for (const double tolerance : kTolerances) {
      test::Accuracy& row = (*measured)[mode("synthetic", max_error, tolerance)];
      QueryConfig config;
      config.tolerance = tolerance;
      ProximityQuery query(model, config);
      std::vector<LinkProximity> results;
      for (int i = 0; i < test::scaled(5000); ++i) {
        const std::size_t k = static_cast<std::size_t>(i) % links.size();
        std::vector<bool> known(links.size(), false);
        known[k] = true;
        const auto points = test::random_points(&rng, links[k], 1 + i % 20);
        const CloudSnapshot cloud = test::make_snapshot(points);
        const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.05);
        query.run(std::vector<Eigen::Isometry3d>(links.size(), X_FL), known, {&cloud}, &results);
        const double truth = test::oracle_minimum(links[k], X_FL, test::stored_points(cloud.index));
        row.add(results[k], truth, config.max_distance, kRounding);
      }
    }
  }
}

// Measures the cases without contact; contact_of_links_test measures depths.
void measure_cases(const std::vector<test::TruthCase>& cases, const CloudSnapshot& cloud,
                   const QueryConfig& config, ProximityQuery* query, test::Accuracy* row) {
  const std::vector<bool> known(test::kPandaLinks, true);
  std::vector<LinkProximity> results;
  for (const test::TruthCase& truth : cases) {
    query->run(truth.X_FL, known, {&cloud}, &results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      if (truth.links[i].points_inside > 0) continue;
      row->add(results[i], truth.links[i].distance, config.max_distance, kTruthRounding);
    }
  }
}

void measure_robot(const std::filesystem::path& data, Measured* measured) {
  std::vector<double> max_errors = {0.005};
  if (updating()) max_errors.push_back(0.002);
  for (const double max_error : max_errors) {
    const auto model = test::panda_model(data, max_error);
    for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
      const CloudSnapshot cloud = test::truth_cloud(data, name);
      for (const char* motion : {"traj", "rand"}) {
        const auto cases = test::truth_cases(data, name, motion);
        for (const double tolerance : kTolerances) {
          test::Accuracy& row = (*measured)[mode("Panda", max_error, tolerance)];
          QueryConfig config;
          config.max_distance = 10.0;
          config.tolerance = tolerance;
          ProximityQuery query(model, config);
          measure_cases(cases, cloud, config, &query, &row);
        }
      }
    }
  }
}

void measure_hard_cases(Measured* exact, Measured* coarse) {
  for (const test::HardScene& scene : test::hard_scenes()) {
    const auto model = test::model_of(scene.links, 0.005);
    const Eigen::Isometry3d X_FL(Eigen::Translation3d{scene.far});
    const std::vector<Eigen::Isometry3d> poses(scene.links.size(), X_FL);
    const std::vector<bool> known(scene.links.size(), true);
    std::vector<LinkProximity> results;
    for (std::vector<Eigen::Vector3d> points : scene.clouds) {
      for (Eigen::Vector3d& p : points) p += scene.far;
      const CloudSnapshot cloud = test::make_snapshot(points, scene.far);
      for (const double tolerance : {0.0, 0.001}) {
        QueryConfig config;
        config.tolerance = tolerance;
        ProximityQuery(model, config).run(poses, known, {&cloud}, &results);
        for (std::size_t i = 0; i < results.size(); ++i) {
          const double truth =
              test::oracle_minimum(scene.links[i], X_FL, test::stored_points(cloud.index));
          // Within the rounding error of max_distance, CLEAR and NEAR are both right.
          Measured& table = tolerance > 0.0 ? *coarse : *exact;
          table[scene.name].add(results[i], truth, config.max_distance, kRounding);
        }
      }
    }
  }
}

std::string modes_table(const Measured& measured) {
  std::string text =
      "| scene | max_error [mm] | tolerance [mm] | cases | violations | largest error [mm] | mean "
      "error [mm] | mean width [mm] |\n|---|---|---|---|---|---|---|---|\n";
  for (const auto& [key, row] : measured.rows()) {
    text += "| " + key + " | " + std::to_string(row.cases) + " | " + std::to_string(row.violations);
    const double tolerance = std::stod(key.substr(key.rfind('|') + 1));
    for (const double value : {row.largest, row.mean_error(), row.mean_width()}) {
      text += " | " + test::number(test::stated_limit(value / kMillimetre, tolerance));
    }
    text += " |\n";
  }
  return text;
}

std::string hard_table(const Measured& exact, Measured coarse) {
  std::string text =
      "| hard case | cases | violations | largest error at tolerance 0 [mm] | largest error at "
      "tolerance 1 mm [mm] |\n|---|---|---|---|---|\n";
  for (const auto& [key, row] : exact.rows()) {
    text += "| " + key + " | " + std::to_string(row.cases) + " | " +
            std::to_string(row.violations + coarse[key].violations) + " | " +
            test::number(test::stated_limit(row.largest / kMillimetre, 0.0)) + " | " +
            test::number(test::stated_limit(coarse[key].largest / kMillimetre, 1.0));
    text += " |\n";
  }
  return text;
}

// Compares measured values with a row's limits, from its column `from` on. The limits are for the
// packing that is made without sanitizers.
void expect_below(const std::vector<std::string>& row, std::size_t from,
                  const std::vector<double>& values) {
  ASSERT_EQ(row.size(), from + values.size());
  if (test::kSanitized) return;
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_LE(values[i] / kMillimetre, std::stod(row[from + i]))
        << row[0] << ", column " << from + i;
  }
}

TEST(AccuracyDocument, ModesAreAsStated) {
  Measured measured;
  measure_synthetic(&measured);
  const auto data = test::data_dir();
  if (data && !test::kSanitized) measure_robot(*data, &measured);
  if (updating()) ASSERT_TRUE(test::replace_table(kDocument, "modes", modes_table(measured)));
  const test::TableRows rows = test::parse_table(test::read_text(kDocument), "modes");
  std::set<std::string> stated;
  for (const std::vector<std::string>& row : rows) {
    ASSERT_EQ(row.size(), 8U);
    const std::string key = row[0] + " | " + row[1] + " | " + row[2];
    SCOPED_TRACE(key);
    stated.insert(key);
    EXPECT_EQ(row[4], "0");
    const test::Accuracy* found = measured.find(key);
    if (found == nullptr) {
      EXPECT_EQ(row[0], "Panda") << "a row that no test measures";
      continue;  // without the data; the 2 mm packing is measured when the document is written
    }
    if (!test::kSanitized) EXPECT_EQ(row[3], std::to_string(found->cases));
    EXPECT_EQ(found->violations, 0);
    expect_below(row, 5, {found->largest, found->mean_error(), found->mean_width()});
  }
  for (const auto& [key, ignored] : measured.rows())
    EXPECT_EQ(stated.count(key), 1U) << key << " is not stated";
}

TEST(AccuracyDocument, HardCasesAreAsStated) {
  Measured exact, coarse;
  measure_hard_cases(&exact, &coarse);
  if (updating())
    ASSERT_TRUE(test::replace_table(kDocument, "hard cases", hard_table(exact, coarse)));
  const test::TableRows rows = test::parse_table(test::read_text(kDocument), "hard cases");
  std::set<std::string> stated;
  for (const std::vector<std::string>& row : rows) {
    ASSERT_EQ(row.size(), 5U);
    SCOPED_TRACE(row[0]);
    stated.insert(row[0]);
    ASSERT_NE(exact.find(row[0]), nullptr) << "a row that no test measures";
    const test::Accuracy &zero = exact[row[0]], &one = coarse[row[0]];
    EXPECT_EQ(row[1], std::to_string(zero.cases));
    EXPECT_EQ(row[2], "0");
    EXPECT_EQ(zero.violations + one.violations, 0);
    expect_below(row, 3, {zero.largest, one.largest});
  }
  for (const auto& [key, ignored] : exact.rows())
    EXPECT_EQ(stated.count(key), 1U) << key << " is not stated";
}

}  // namespace
}  // namespace ist
