#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The `error` of a link that is not made yet, but will be.
constexpr const char* kPending = "it is not ready yet";
inline bool is_pending(const LinkModel& link) { return link.error == kPending; }

/// A robot model that can be used after every step of its making, as an anytime algorithm is (Dean
/// and Boddy 1988): with coarse packings first, then with distance fields, which make queries fast,
/// and where spheres themselves are needed with final packings. Answers are right from the first
/// step on.
///
/// Immutable. Each step gives a new model, which shares what has not changed: links keep their
/// place and their exact geometry, and all but the packed link keep their packing_id. Thread safe.
class AnytimeModel {
 public:
  using Ptr = std::shared_ptr<const AnytimeModel>;

  AnytimeModel();  ///< empty; build() makes one to use
  AnytimeModel(const AnytimeModel& other);
  AnytimeModel& operator=(const AnytimeModel&) = delete;
  ~AnytimeModel();

  /// The goal that shapes are packed to.
  enum class Stage {
    kFirst,  ///< a few dozen spheres a shape, unless its final packing is in the cache
    kFinal,  ///< config.packing
  };

  /// Takes a model in which some links are pending.
  using Partial = std::function<void(const Ptr&)>;

  /// Packs every monitored link, equal shapes once, on config.threads threads.
  /// @param description  not null
  /// @param partial      not empty: links are made in a few groups, those with the least work
  /// first,
  ///                     and it is called after each group but the last
  /// @returns null when cancelled
  /// @throws ModelError when the packing configuration is out of range
  static Ptr build(std::shared_ptr<const RobotDescription> description,
                   const RobotModelConfig& config, Stage stage,
                   const RobotModelCallbacks& callbacks = {}, const Partial& partial = {});

  /// Packs the shapes of one link to config.packing, in the calling thread. Other links of the
  /// same shapes get the packing too. A shape that cannot be packed so, for want of memory for
  /// example, keeps its packing for good, with a warning.
  /// @param link  index in robot(), not final
  /// @returns null when cancelled
  Ptr refined(std::size_t link, const RobotModelCallbacks& callbacks = {}) const;

  /// The same model with the distance field of a link: a fine one from the cache, or measured in
  /// the calling thread, a coarse one where there is none, else a fine one. Other links of the same
  /// solid get it too.
  /// @param link  index in robot(), usable
  /// @returns null when cancelled
  Ptr with_field(std::size_t link, const RobotModelCallbacks& callbacks = {}) const;

  /// A step that a link can take, in their order.
  enum class LinkStep {
    kCoarseField,  ///< with_field()
    kFineField,    ///< with_field()
    kSpheres,      ///< refined(): for contact volumes and the depth of link pairs
    kNone,         ///< the link is complete, or has no geometry
  };
  static LinkStep next_step(const LinkModel& link);
  /// The model after the next step of a link.
  /// @param link  index in robot(), not complete
  /// @returns null when cancelled
  Ptr advanced(std::size_t link, const RobotModelCallbacks& callbacks = {}) const;

  /// The same model with the packings of another one where those are finer, and with the fields
  /// that it has measured of the same solids.
  Ptr with_packings_of(const AnytimeModel& other) const;

  /// The model of a description that differs in one link. Shapes that are not known yet are packed
  /// to the final stage, the others stay as they are.
  /// @param link    without geometry it is left out, unless `config.links` names it
  /// @param config  differs in `links` only
  /// @returns null when cancelled
  Ptr with_link(std::shared_ptr<const RobotDescription> description, const std::string& link,
                const RobotModelConfig& config, const RobotModelCallbacks& callbacks = {}) const;

  const std::shared_ptr<const RobotModel>& robot() const { return robot_; }
  const RobotDescription& description() const { return *description_; }

 private:
  /// The packing of a shape, as fine as it has got.
  struct ShapePacking {
    Packing packing;
    bool is_final = true, from_cache = false;
    double time = 0.0;  ///< [s]
    std::string error;  ///< why there is no packing
  };
  struct Link;
  class Step;

  std::shared_ptr<const RobotDescription> description_;
  RobotModelConfig config_;
  std::vector<Link> links_;
  std::map<std::string, std::shared_ptr<const ShapePacking>> shapes_;  ///< by key
  std::shared_ptr<const RobotModel> robot_;
};

}  // namespace ist
