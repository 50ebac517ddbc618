#include "cloud/maps/map_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace ist {
namespace {

// A file that is closed with the object.
class File {
 public:
  // O_NONBLOCK: to open a FIFO that nobody writes to would wait for a writer. It has no effect on
  // regular files.
  explicit File(const std::string& path)
      : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  ~File() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  int descriptor() const { return descriptor_; }

 private:
  const int descriptor_;
};

std::string cannot_be_read() {
  return std::string("cannot be read: ") + std::strerror(errno) + ".";
}

}  // namespace

std::string read_map_bytes(const std::string& path, std::size_t max_bytes, std::string* bytes) {
  bytes->clear();
  const File file(path);
  if (file.descriptor() < 0) return cannot_be_read();
  struct stat status {};
  if (::fstat(file.descriptor(), &status) != 0) return cannot_be_read();
  if (!S_ISREG(status.st_mode)) {
    return "cannot be read: it is no regular file (but a folder, a FIFO or a device).";
  }
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size > max_bytes) {
    return "has " + std::to_string(size) + " bytes, allowed are at most " +
           std::to_string(max_bytes) + " (max_bytes).";
  }
  bytes->resize(size);
  std::size_t done = 0;
  while (done < size) {
    const ssize_t count = ::read(file.descriptor(), &(*bytes)[done], size - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return cannot_be_read();
    if (count == 0) break;  // the file has been cut off meanwhile
    done += static_cast<std::size_t>(count);
  }
  bytes->resize(done);
  return {};
}

}  // namespace ist
