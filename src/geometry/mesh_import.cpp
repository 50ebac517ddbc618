#include "geometry/mesh_import.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/ProgressHandler.hpp>
#include <cstring>
#include <exception>
#include <memory>
#include <utility>

#include "geometry/mesh_file_checks.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/regular_file.h"

namespace ist {
namespace {

// Bytes in memory, read only.
class MemoryStream : public Assimp::IOStream {
 public:
  MemoryStream(std::shared_ptr<const std::string> bytes, const CancelRequest& cancelled)
      : bytes_(std::move(bytes)), cancelled_(cancelled) {}

  std::size_t Read(void* buffer, std::size_t size, std::size_t count) override {
    throw_if(cancelled_);
    if (size == 0) return 0;
    const std::size_t items = std::min(count, (bytes_->size() - at_) / size);
    if (items > 0) std::memcpy(buffer, bytes_->data() + at_, items * size);
    at_ += items * size;
    return items;
  }

  aiReturn Seek(std::size_t offset, aiOrigin origin) override {
    // Offsets from the present position may be negative, in two's complement.
    std::size_t target = offset;
    if (origin == aiOrigin_CUR) target = at_ + offset;
    if (origin == aiOrigin_END) target = bytes_->size() + offset;
    if (target > bytes_->size()) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }

  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return bytes_->size(); }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  void Flush() override {}

 private:
  const std::shared_ptr<const std::string> bytes_;
  const CancelRequest& cancelled_;
  std::size_t at_ = 0;
};

// Assimp asks it now and then, and between its steps, whether to go on.
class Progress : public Assimp::ProgressHandler {
 public:
  explicit Progress(const CancelRequest& cancelled) : cancelled_(cancelled) {}
  bool Update(float /*done*/) override {
    throw_if(cancelled_);  // some importers do not ask for what is returned
    return true;
  }

 private:
  const CancelRequest& cancelled_;
};

class MeshFiles : public Assimp::IOSystem {
 public:
  MeshFiles(std::string path, const std::string& bytes, const CancelRequest& cancelled)
      : path_(std::move(path)),
        // The bytes outlive this, so the pointer does not own them.
        bytes_(std::shared_ptr<const std::string>(), &bytes),
        cancelled_(cancelled) {}

  bool Exists(const char* name) const override { return path_ == name || read(name) != nullptr; }
  char getOsSeparator() const override { return '/'; }

  Assimp::IOStream* Open(const char* name, const char* mode) override {
    if (std::strchr(mode, 'w') != nullptr || std::strchr(mode, 'a') != nullptr) return nullptr;
    const auto bytes = path_ == name ? bytes_ : read(name);
    return bytes != nullptr ? new MemoryStream(bytes, cancelled_) : nullptr;
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  std::shared_ptr<const std::string> read(const char* name) const {
    if (mesh_format(name) == "mtl") return nullptr;
    auto bytes = std::make_shared<std::string>();
    return read_regular_file(name, kMaxMeshFileSize, bytes.get(), cancelled_).empty() ? bytes
                                                                                      : nullptr;
  }

  const std::string path_;
  const std::shared_ptr<const std::string> bytes_;
  const CancelRequest& cancelled_;
};

}  // namespace

const aiScene* import_mesh(const std::string& path, const std::string& bytes,
                           const CancelRequest& cancelled, Assimp::Importer* importer,
                           std::string* reason) {
  // A Collada file's up-axis is not applied to links (REP 103 is Z up, and so rviz shows it).
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  importer->SetIOHandler(new MeshFiles(path, bytes, cancelled));  // the importer deletes it
  Progress progress(cancelled);
  importer->SetProgressHandler(&progress);
  const aiScene* scene = nullptr;
  try {
    scene = importer->ReadFile(path, aiProcess_Triangulate | aiProcess_SortByPType);
    *reason = importer->GetErrorString();
  } catch (const std::exception& error) {
    *reason = error.what();
  }
  importer->SetProgressHandler(nullptr);
  throw_if(cancelled);  // assimp makes an error of its own of the exception
  return scene != nullptr && scene->mRootNode != nullptr ? scene : nullptr;
}

}  // namespace ist
