#include "proximity/coherence/scene_tracker.h"

namespace ist {

bool same_extent(const PointExtent& a, const PointExtent& b) {
  return a.constant == b.constant && a.linear == b.linear && a.quadratic == b.quadratic &&
         a.max_range == b.max_range && a.p_FS == b.p_FS;
}

SceneTracker::Cloud SceneTracker::identity(const CloudSnapshot& cloud) {
  Cloud id;
  id.region = cloud.region;
  id.extent = cloud.extent;
  id.box_extent = cloud.box_extent;
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
           now.region.radius == clouds_[i].region.radius &&
           now.box_extent == clouds_[i].box_extent && same_extent(now.extent, clouds_[i].extent);
    clouds_[i] = now;
  }
  count_ = clouds.size();
  if (!same) ++id_;
  return clouds.size() > clouds_.size() ? kUnknownScene : id_;
}

}  // namespace ist
