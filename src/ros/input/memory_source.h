#pragma once

#include <memory>
#include <string>

#include "ros/input/obstacle_source.h"
#include "ros/input/source_memory.h"

namespace ist {

/// What another source remembers, as a source of its own: NAME/memory. Beside a fresh cloud its
/// snapshots come with those of that source (see CloudSelection), else they are its own.
class MemorySource : public ObstacleSource {
 public:
  /// @param parent  outlives this
  /// @param memory  of `parent`
  MemorySource(const ObstacleSource& parent, std::shared_ptr<SourceMemory> memory,
               std::string topic)
      : parent_(parent), memory_(std::move(memory)), topic_(std::move(topic)) {}

  void set_model(std::shared_ptr<const RobotModel> /*model*/, const std::string& /*fixed_frame*/,
                 const RegionOfInterest& /*region*/) override {}
  const SourceSnapshot* newest(const std::shared_ptr<const RobotModel>& /*model*/,
                               const ros::Time& /*time*/, double /*max_age*/) override {
    return memory_->newest();
  }
  std::shared_ptr<const SourceSnapshot> share(const std::shared_ptr<const RobotModel>& /*model*/,
                                              const ros::Time& /*time*/,
                                              double /*max_age*/) override {
    return memory_->share();
  }
  void report(SourceReport* report) override;
  const ObstacleSource* parent() const override { return &parent_; }

 private:
  const ObstacleSource& parent_;
  const std::shared_ptr<SourceMemory> memory_;
  const std::string topic_;
};

}  // namespace ist
