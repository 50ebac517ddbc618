#include "internal/geometry/regular_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace ist {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 20U;

class FileDescriptor {
 public:
  // Opening a FIFO waits for its other end without O_NONBLOCK; regular files do not know it.
  explicit FileDescriptor(const std::string& path)
      : fd_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

std::string fault_of(const struct stat& status, std::size_t max_size) {
  if (S_ISDIR(status.st_mode)) return "is a directory";
  if (!S_ISREG(status.st_mode)) {
    return "is no regular file but a FIFO, a device or a socket; only regular files are read";
  }
  if (static_cast<std::uint64_t>(status.st_size) > max_size) {
    return "has " + std::to_string(status.st_size) + " bytes; allowed are at most " +
           std::to_string(max_size);
  }
  return "";
}

}  // namespace

std::string read_regular_file(const std::string& path, std::size_t max_size, std::string* bytes,
                              const CancelRequest& cancelled) {
  bytes->clear();
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return "does not exist";
    return std::string("cannot be opened (") + std::strerror(errno) + ")";
  }
  // Before it is opened, since that alone wakes some devices; and again after, for it may change.
  std::string fault = fault_of(status, max_size);
  if (!fault.empty()) return fault;
  const FileDescriptor file(path);
  if (file.get() < 0) return std::string("cannot be opened (") + std::strerror(errno) + ")";
  if (fstat(file.get(), &status) != 0)
    return std::string("cannot be read (") + std::strerror(errno) + ")";
  fault = fault_of(status, max_size);
  if (!fault.empty()) return fault;
  const auto size = static_cast<std::size_t>(status.st_size);
  bytes->resize(size);
  for (std::size_t at = 0; at < size;) {
    throw_if(cancelled);
    const ssize_t n = read(file.get(), &(*bytes)[at], std::min(kChunk, size - at));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return std::string("cannot be read (") + std::strerror(errno) + ")";
    if (n == 0) {  // it has become shorter
      bytes->resize(at);
      break;
    }
    at += static_cast<std::size_t>(n);
  }
  return "";
}

}  // namespace ist
