#pragma once

#include <ist_proximity/ListLinkPairs.h>
#include <ros/node_handle.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ros/add_ons/add_on.h"
#include "ros/common/callback_thread.h"
#include "ros/services/pair_choice.h"

namespace ist {

/// Answers ~link_pairs: which pairs of links are watched, why the others are not, and what sampling
/// found. A thread of low priority samples the pairs of each new model, or reads the result from
/// the cache. Sampling informs; it leaves no pair out.
class LinkPairService {
 public:
  explicit LinkPairService(const AddOnContext& node);

 private:
  using Service = ist_proximity::ListLinkPairs;

  /// What is known of one model.
  struct Findings {
    std::shared_ptr<const ModelState> model;
    std::vector<ChosenPair> chosen;
    std::vector<SampledPair> sampled;  ///< of all pairs that are not adjacent; empty: not yet
    std::string problem;               ///< why there are no samples
  };

  void sample_newest();
  void sample(Findings* findings);
  static std::string left_out_though_apart(const Findings& findings);
  bool is_outdated(const ModelState& model) const;
  bool answer(Service::Request& request, Service::Response& response);

  AddOnContext node_;
  std::shared_ptr<const ModelState> model_;  ///< of the last sampling; the thread's own
  /// Null before the first model; loaded and stored atomically.
  std::shared_ptr<const Findings> findings_;
  ros::ServiceServer service_;
  CallbackThread thread_;
};

}  // namespace ist
