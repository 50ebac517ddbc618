#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <vector>

namespace ist::benchmark {

/// Subscribers and publishers with their own thread.
class Part {
 public:
  Part() { nh_.setCallbackQueue(&queue_); }
  ros::NodeHandle& nh() { return nh_; }
  void start() { spinner_.start(); }
  void stop() { spinner_.stop(); }

 private:
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::AsyncSpinner spinner_{1, &queue_};
};

/// A child process that ends with this object.
class Process {
 public:
  explicit Process(std::vector<std::string> command) : pid_(fork()) {
    if (pid_ != 0) return;
    std::vector<char*> words;
    for (std::string& word : command) words.push_back(word.data());
    words.push_back(nullptr);
    execv(words[0], words.data());
    _exit(127);
  }
  ~Process() {
    kill(pid_, SIGINT);
    waitpid(pid_, nullptr, 0);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

 private:
  pid_t pid_;
};

/// [s] After the first answer the node packs finer spheres, distance fields and contact volumes. On
/// two cores it needs a third of this for the Panda.
constexpr double kPackingTime = 60.0;

inline void wait(double seconds) {
  for (double t = 0.0; ros::ok() && t < seconds; t += 0.05) ros::WallDuration(0.05).sleep();
}

}  // namespace ist::benchmark
