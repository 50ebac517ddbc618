#include "internal/robot/package_resolver.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

bool has_file(const fs::path& folder, const char* name) {
  std::error_code ignored;
  return fs::is_regular_file(folder / name, ignored);
}

// The name of the package in this folder, or an empty string.
std::string package_name(const fs::path& folder) {
  if (has_file(folder, "package.xml")) {
    tinyxml2::XMLDocument document;
    if (document.LoadFile((folder / "package.xml").c_str()) != tinyxml2::XML_SUCCESS) return "";
    const tinyxml2::XMLElement* package = document.FirstChildElement("package");
    const tinyxml2::XMLElement* name =
        package != nullptr ? package->FirstChildElement("name") : nullptr;
    return name != nullptr && name->GetText() != nullptr ? trimmed(name->GetText()) : "";
  }
  return has_file(folder, "manifest.xml") ? folder.filename().string() : "";
}

std::vector<fs::path> subfolders(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  fs::directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    const bool hidden = entry->path().filename().string().front() == '.';
    if (!hidden && entry->is_directory(ignored)) found.push_back(entry->path());
  }
  std::sort(found.begin(), found.end());  // the same answer on every file system
  return found;
}

// Packages below the folders of a search path. A folder is crawled once, the first time that a
// package is not found in the folders before it.
class PackageIndex {
 public:
  explicit PackageIndex(const std::string& search_path) {
    std::istringstream stream(search_path);
    for (std::string folder; std::getline(stream, folder, ':');) {
      if (!folder.empty()) roots_.push_back(Root{folder, false, {}});
    }
  }

  std::string find(const std::string& package) {
    if (package.empty()) return "";
    const std::lock_guard<std::mutex> lock(mutex_);
    for (Root& root : roots_) {
      // The usual layout answers without crawling all of it (/opt/ros/.../share is large).
      if (package_name(root.folder / package) == package) return (root.folder / package).string();
      if (!root.crawled) {
        std::set<fs::path> visited;
        crawl(root.folder, &visited, &root.packages);
        root.crawled = true;
      }
      const auto found = root.packages.find(package);
      if (found != root.packages.end()) return found->second.string();
    }
    return "";
  }

 private:
  struct Root {
    fs::path folder;
    bool crawled;
    std::map<std::string, fs::path> packages;
  };

  // The rules of rospack: it does not search inside a package, and the first of a name wins.
  static void crawl(const fs::path& folder, std::set<fs::path>* visited,
                    std::map<std::string, fs::path>* packages) {
    std::error_code error;
    const fs::path canonical = fs::canonical(folder, error);
    if (error || !visited->insert(canonical).second) return;  // links may form loops
    if (has_file(folder, "CATKIN_IGNORE")) return;
    const std::string name = package_name(folder);
    if (!name.empty()) {
      packages->insert({name, folder});
      return;
    }
    if (has_file(folder, "rospack_nosubdirs")) return;
    for (const fs::path& child : subfolders(folder)) crawl(child, visited, packages);
  }

  std::mutex mutex_;
  std::vector<Root> roots_;
};

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// Decodes %20 and the like; a % that starts no such code stays as it is.
std::string percent_decoded(const std::string& text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
    if (low >= 0) {
      decoded.push_back(static_cast<char>(high * 16 + low));
      i += 2;
    } else {
      decoded.push_back(text[i]);
    }
  }
  return decoded;
}

bool starts_with(const std::string& text, const std::string& prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

[[noreturn]] void fail(const std::string& uri, const std::string& what) {
  throw ModelError("mesh URI '" + printable(uri) + "' " + what);
}

std::string decoded_path(const std::string& uri, const std::string& encoded) {
  std::string path = percent_decoded(encoded);
  if (path.find('\0') != std::string::npos) fail(uri, "holds the character 0, written as %00");
  return path;
}

// Whether '..' leads above the folder that a path starts from, at the end or in between: what is
// above a package is none of its files.
bool leaves_folder(const std::string& path) {
  int depth = 0;
  for (const fs::path& part : fs::path(path).relative_path()) {
    if (part == "..") --depth;
    if (!part.empty() && part != "." && part != "..") ++depth;
    if (depth < 0) return true;
  }
  return false;
}

std::string resolve_package_uri(const std::string& uri, const PackageFinder& find_package) {
  const std::string rest = uri.substr(std::string("package://").size());
  const std::size_t slash = rest.find('/');
  const std::string package = rest.substr(0, slash);
  if (package.empty() || package == "." || package == "..") {
    fail(uri, "names no package; write package://PACKAGE/PATH");
  }
  if (slash == std::string::npos || slash + 1 == rest.size()) {
    fail(uri, "names no file in the package; write package://PACKAGE/PATH");
  }
  const std::string folder = find_package ? find_package(package) : "";
  if (folder.empty()) {
    fail(uri, "names package '" + package +
                  "', which is not found; source the workspace that holds it or add its folder to "
                  "ROS_PACKAGE_PATH");
  }
  const std::string path = decoded_path(uri, rest.substr(slash));
  if (leaves_folder(path)) {
    fail(uri, "leads out of package '" + package + "' by '..'; name a file in the package");
  }
  return folder + path;
}

std::string resolve_file_uri(const std::string& uri) {
  std::string path = uri.substr(std::string("file:").size());
  if (starts_with(path, "//")) {
    const std::size_t slash = path.find('/', 2);
    const std::string host = path.substr(2, slash == std::string::npos ? slash : slash - 2);
    if (!host.empty() && host != "localhost") {
      fail(uri, "names a file on host '" + host +
                    "'; an absolute local path has three slashes: file:///PATH");
    }
    path = slash == std::string::npos ? "" : path.substr(slash);
  }
  if (path.size() < 2 || path[0] != '/') fail(uri, "names no file; write file:///PATH");
  return decoded_path(uri, path);
}

}  // namespace

PackageFinder environment_package_finder() {
  const char* search_path = std::getenv("ROS_PACKAGE_PATH");
  const auto index = std::make_shared<PackageIndex>(search_path != nullptr ? search_path : "");
  return [index](const std::string& package) { return index->find(package); };
}

PackageFinder file_package_finder(const std::string& urdf_file,
                                  const std::vector<std::string>& package_dirs) {
  const PackageFinder others = environment_package_finder();
  std::string folder = urdf_file.empty() ? "" : fs::absolute(urdf_file).parent_path().string();
  return [others, folder, package_dirs](const std::string& package) -> std::string {
    if (package.empty()) return folder;
    for (const std::string& dir : package_dirs) {
      // A path that ends in a slash has no file name.
      const fs::path parent = fs::absolute(dir + "/").parent_path();
      std::error_code ignored;
      if (fs::is_directory(parent / package, ignored)) return (parent / package).string();
      if (parent.filename() == package) return parent.string();
    }
    return others(package);
  };
}

std::string resolve_uri(const std::string& uri, const PackageFinder& find_package) {
  if (uri.empty()) throw ModelError("mesh URI is empty; write package://PACKAGE/PATH");
  if (starts_with(uri, "package://")) return resolve_package_uri(uri, find_package);
  if (starts_with(uri, "file:")) return resolve_file_uri(uri);
  if (uri.front() == '/') return uri;
  const std::size_t colon = uri.find("://");
  if (colon != std::string::npos) {
    fail(uri, "has the unknown scheme '" + uri.substr(0, colon) +
                  "'; package://PACKAGE/PATH and file:///PATH are known");
  }
  const std::string folder = find_package ? find_package("") : "";
  if (!folder.empty()) return (fs::path(folder) / uri).string();
  fail(uri,
       "is a relative path, and a URDF that is a text or on the parameter server has no folder to "
       "start from; write package://PACKAGE/PATH or file:///PATH");
}

}  // namespace ist
