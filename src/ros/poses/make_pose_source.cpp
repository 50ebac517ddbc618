#include "ros/poses/make_pose_source.h"

#include <string>
#include <vector>

#include "ros/poses/tf_pose_source.h"

namespace ist {

std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const TransformBuffer& buffer,
                                             JointStateListener* joints,
                                             JointPoseSource::Which which) {
  const std::string fixed_frame = fixed_frame_of(model, config);
  const std::vector<std::string> names = link_names(*model.robot);
  const std::vector<bool> wanted = wanted_links(model);
  if (!joints) {
    return std::make_unique<TfPoseSource>(buffer, fixed_frame, names, wanted, config.pose_timeout);
  }
  if (!model.kinematics) return nullptr;
  return std::make_unique<JointPoseSource>(model.kinematics, joints, which, buffer, fixed_frame,
                                           names, wanted, config.pose_timeout);
}

}  // namespace ist
