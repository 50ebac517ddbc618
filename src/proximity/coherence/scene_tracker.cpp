#include "proximity/coherence/scene_tracker.h"

namespace ist {

SceneTracker::Cloud SceneTracker::identity(const CloudSnapshot& cloud) {
  Cloud id;
  id.region = cloud.region;
  if (!cloud.index.empty()) id.points = cloud.index.build_id();
  if (cloud.boxes == nullptr || cloud.boxes->empty()) return id;
  id.boxes = cloud.boxes->build_id();
  id.X_FM = cloud.X_FM.matrix().topRows<3>();
  return id;
}

SceneId SceneTracker::identify(SnapshotSpan clouds) {
  bool same = clouds.size() == count_;
  for (std::size_t i = 0; i < clouds.size() && i < clouds_.size(); ++i) {
    const Cloud now = identity(*clouds[i]);
    same = same && now.points == clouds_[i].points && now.boxes == clouds_[i].boxes &&
           now.X_FM == clouds_[i].X_FM && now.region.center_F == clouds_[i].region.center_F &&
           now.region.radius == clouds_[i].region.radius;
    clouds_[i] = now;
  }
  count_ = clouds.size();
  if (!same) ++id_;
  return clouds.size() > clouds_.size() ? kUnknownScene : id_;
}

}  // namespace ist
