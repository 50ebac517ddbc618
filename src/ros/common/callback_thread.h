#pragma once

#include <ros/callback_queue.h>
#include <ros/console.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "ros/common/exceptions.h"
#include "ros/common/thread_name.h"

namespace ist {

/// A callback queue with a thread of its own. An exception in a callback is logged, and the thread
/// goes on with the next one. Subscribers and services that use the queue must be shut down after
/// stop().
class CallbackThread {
 public:
  CallbackThread() = default;
  ~CallbackThread() { stop(); }
  CallbackThread(const CallbackThread&) = delete;
  CallbackThread& operator=(const CallbackThread&) = delete;

  ros::CallbackQueue* queue() { return &queue_; }

  /// Starts the thread.
  /// @param meanwhile      called between the rounds of callbacks, 20 times a second or more often
  /// @param is_background  gives it a low priority
  void start(const std::string& name, std::function<void()> meanwhile, bool is_background = false) {
    thread_ = std::thread([this, name, is_background, meanwhile = std::move(meanwhile)] {
      name_thread(name);
      if (is_background) lower_thread_priority();
      while (running_) {
        const std::string fault = exception_of([&] {
          meanwhile();
          queue_.callAvailable(ros::WallDuration(0.05));
        });
        if (fault.empty()) continue;
        ROS_ERROR_STREAM_THROTTLE(
            5.0, "a task of thread '" << name << "' is dropped, it failed: " << fault);
      }
    });
  }

  /// Waits for the present callback and ends the thread.
  void stop() {
    running_ = false;
    if (thread_.joinable()) thread_.join();
  }

  /// False once stop() is called; long callbacks look at it.
  bool is_running() const { return running_; }

 private:
  ros::CallbackQueue queue_;
  std::atomic<bool> running_{true};
  std::thread thread_;
};

}  // namespace ist
