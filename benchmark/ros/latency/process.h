#pragma once

#include <ros/ros.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace ist::benchmark {

/// A child process that ends with this object.
class Process {
 public:
  explicit Process(const std::vector<std::string>& command) : pid_(fork()) {
    if (pid_ != 0) return;
    std::vector<char*> arguments;
    for (const std::string& argument : command) {
      arguments.push_back(const_cast<char*>(argument.c_str()));
    }
    arguments.push_back(nullptr);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  pid_t pid() const { return pid_; }
  ~Process() {
    kill(pid_, SIGINT);
    waitpid(pid_, nullptr, 0);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

 private:
  pid_t pid_;
};

/// Processor time [s] of a process by thread name.
inline std::map<std::string, double> thread_times(pid_t process) {
  std::map<std::string, double> times;
  const std::string tasks = "/proc/" + std::to_string(process) + "/task";
  for (const auto& task : std::filesystem::directory_iterator(tasks)) {
    std::ifstream file(task.path() / "stat");
    std::string line;
    std::getline(file, line);
    const std::size_t open = line.find('('), close = line.rfind(')');
    if (close == std::string::npos) continue;
    std::istringstream rest(line.substr(close + 2));
    std::string skipped;
    for (int i = 0; i < 11; ++i) rest >> skipped;
    double user = 0.0, system = 0.0;
    rest >> user >> system;
    times[line.substr(open + 1, close - open - 1)] +=
        (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  }
  return times;
}

// [s] After the first answer the node packs finer spheres, distance fields and contact volumes,
// when that pays. The measurement begins when it has stopped: when these threads took next to no
// time for the time of a look. After the longest wait it begins in any case, with packing beside
// it.
constexpr double kShortestWait = 20.0, kLook = 5.0, kLongestWait = 300.0;
constexpr double kIdle = 0.01;  // share of a processor

inline void wait(double seconds) {
  for (double t = 0.0; ros::ok() && t < seconds; t += 0.05) ros::WallDuration(0.05).sleep();
}

/// Waits until the node has packed all that its links need now.
/// @param process  the node's
inline void settle(pid_t process) {
  const auto packing = [process] {
    std::map<std::string, double> times = thread_times(process);
    return times["ist model"] + times["ist packing"] + times["ist contact"];
  };
  double last = packing();
  for (double t = 0.0; ros::ok() && t < kLongestWait; t += kLook) {
    wait(kLook);
    const double now = packing();
    if (now - last < kIdle * kLook && t + kLook >= kShortestWait) return;
    last = now;
  }
  std::fprintf(stderr, "the node is still packing\n");
}

}  // namespace ist::benchmark
