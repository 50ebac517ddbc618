#include "ros/model/progress_report.h"

#include <ros/console.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace ist {
namespace {

constexpr std::chrono::milliseconds kRedraw(100), kNextLine(3000);
constexpr int kBarWidth = 30;

int percent(double fraction) { return static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0)); }

}  // namespace

ProgressReport::ProgressReport()
    : is_terminal_(isatty(STDERR_FILENO) == 1),
      // Links from the cache are done before the first line would appear.
      next_(std::chrono::steady_clock::now() + (is_terminal_ ? kRedraw : kNextLine)) {}

std::string ProgressReport::sentence(const ModelProgress& progress) {
  return "packing link '" + progress.link + "' (" + std::to_string(progress.index + 1) + " of " +
         std::to_string(progress.count) + "), " + std::to_string(percent(progress.fraction)) +
         " % of the robot done";
}

void ProgressReport::update(const ModelProgress& progress) {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + (is_terminal_ ? kRedraw : kNextLine);
  if (!is_terminal_) {
    ROS_INFO_STREAM(sentence(progress));
    return;
  }
  const int full = percent(progress.fraction) * kBarWidth / 100;
  const std::string bar = std::string(static_cast<std::size_t>(full), '#') +
                          std::string(static_cast<std::size_t>(kBarWidth - full), '.');
  std::fprintf(stderr, "\r[%s] %3d %%  %-40.40s", bar.c_str(), percent(progress.fraction),
               progress.link.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressReport::finish() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
}

}  // namespace ist
