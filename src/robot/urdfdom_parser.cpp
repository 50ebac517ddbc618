#include "internal/robot/urdfdom_parser.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <exception>
#include <mutex>
#include <thread>

namespace ist {
namespace {

// Captures urdfdom's messages during its lifetime; messages of other threads go to the previous
// handler.
class MessageCapture : public console_bridge::OutputHandler {
 public:
  MessageCapture()
      : lock_(mutex()),
        previous_(console_bridge::getOutputHandler()),
        thread_(std::this_thread::get_id()) {
    console_bridge::useOutputHandler(this);
  }

  ~MessageCapture() override {
    // Twice, because console_bridge remembers one previous handler, which would be this one.
    console_bridge::useOutputHandler(previous_);
    console_bridge::useOutputHandler(previous_);
  }

  MessageCapture(const MessageCapture&) = delete;
  MessageCapture& operator=(const MessageCapture&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* file,
           int line) override {
    if (std::this_thread::get_id() != thread_) {
      if (previous_ != nullptr) previous_->log(text, level, file, line);
    } else if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) {
      errors_.push_back(text);
    }
  }

  const std::vector<std::string>& errors() const { return errors_; }

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }

  const std::lock_guard<std::mutex> lock_;
  console_bridge::OutputHandler* const previous_;
  const std::thread::id thread_;
  std::vector<std::string> errors_;
};

}  // namespace

ParsedUrdf parse_with_urdfdom(const tinyxml2::XMLDocument& document) {
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  ParsedUrdf parsed;
  const MessageCapture capture;
  try {
    parsed.model = urdf::parseURDF(printer.CStr());
    parsed.errors = capture.errors();
  } catch (const std::exception& error) {
    parsed.errors = {error.what()};
  }
  if (parsed.model == nullptr && parsed.errors.empty()) {
    parsed.errors = {"urdfdom gives no reason"};
  }
  return parsed;
}

}  // namespace ist
