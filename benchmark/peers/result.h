#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "peers/method.h"
#include "support.h"

/// Measurements of a method, and their CSV file.
namespace ist::benchmark {

/// Measurements of one method on one data set. "free" is without contact.
struct Result {
  std::vector<double> ingest, query, free_query, motion, free_motion;  // [us]
  std::vector<double> frame, free_frame, first, free_first;  // [us] first query after an image
  std::vector<double> error;                                 // [m] without contact
  std::size_t failures = 0, answers = 0;
};

inline const char* name_of(Kind kind) {
  switch (kind) {
    case Kind::kOurs:
      return "ours";
    case Kind::kExact:
      return "exact";
    case Kind::kSpheres:
      return "spheres";
    case Kind::kGrid:
      return "grid";
  }
  return "";
}

inline void print_header(std::FILE* csv) {
  std::fprintf(csv,
               "data,method,kind,spheres,max_error_mm,tolerance_mm,configurations,answers,failures,"
               "ingest_us,ingest_p99_us,query_us,query_p99_us,query_max_us,free_query_us,"
               "free_query_p99_us,free_query_max_us,"
               "error_mean_mm,error_least_mm,error_largest_mm,motion_queries,motion_us,"
               "motion_p99_us,motion_max_us,motion_mean_us,free_motion_us,free_motion_p99_us,"
               "free_motion_max_us,frames,frame_us,frame_p99_us,frame_max_us,free_frame_us,"
               "first_us,first_p99_us,first_max_us,free_first_us\n");
}

inline void print(std::FILE* csv, const std::string& data, const Method& method, const Result& r) {
  std::vector<double> size = r.error;
  for (double& error : size) error = std::abs(error);
  std::fprintf(csv, "%s,\"%s\",%s,%zu,%g,%g,%zu,%zu,%zu", data.c_str(), method.name.c_str(),
               name_of(method.kind), method.spheres, 1e3 * method.max_error, 1e3 * method.tolerance,
               r.query.size(), r.answers, r.failures);
  std::fprintf(csv, ",%.1f,%.1f", quantile(r.ingest, 0.5), quantile(r.ingest, 0.99));
  for (const auto* times : {&r.query, &r.free_query}) {
    std::fprintf(csv, ",%.1f,%.1f,%.1f", quantile(*times, 0.5), quantile(*times, 0.99),
                 quantile(*times, 1.0));
  }
  std::fprintf(csv, ",%.5f,%.5f,%.5f,%zu", 1e3 * mean(size), 1e3 * quantile(r.error, 0.0),
               1e3 * quantile(r.error, 1.0), r.motion.size());
  std::fprintf(csv, ",%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f", quantile(r.motion, 0.5),
               quantile(r.motion, 0.99), quantile(r.motion, 1.0), mean(r.motion),
               quantile(r.free_motion, 0.5), quantile(r.free_motion, 0.99),
               quantile(r.free_motion, 1.0));
  std::fprintf(csv, ",%zu,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n", r.frame.size(),
               quantile(r.frame, 0.5), quantile(r.frame, 0.99), quantile(r.frame, 1.0),
               quantile(r.free_frame, 0.5), quantile(r.first, 0.5), quantile(r.first, 0.99),
               quantile(r.first, 1.0), quantile(r.free_first, 0.5));
  std::fflush(csv);
}

}  // namespace ist::benchmark
