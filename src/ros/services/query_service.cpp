#include "ros/services/query_service.h"

#include <algorithm>
#include <cmath>
#include <exception>

#include "internal/geometry/numbers.h"
#include "ros/common/memory.h"

namespace ist {

using ist_proximity::ProximityArray;

namespace {

// An answer with more states takes megabytes.
constexpr std::size_t kManyStates = 1000;
constexpr std::size_t kMaxAnswers = 100000;          // of one request: they take 60 MB
constexpr std::chrono::seconds kReturnMemoryFor(5);  // a slow client reads the answer meanwhile

/// Checks the times of a motion.
/// @returns empty, or what is wrong with them
std::string check_times(const std::vector<double>& times, std::size_t states) {
  if (times.empty()) return "";
  if (times.size() != states || states < 2) {
    return std::to_string(times.size()) + " times and " + std::to_string(states) +
           " states: a motion needs one time per state, and two states";
  }
  for (std::size_t i = 0; i < states; ++i) {
    if (!std::isfinite(times[i]) ||
        (i > 0 && !(times[i] > times[i - 1] && std::isfinite(times[i] - times[i - 1])))) {
      return "times[" + std::to_string(i) + "] is " + std::to_string(times[i]) +
             ": times have to be finite and to rise";
    }
  }
  return "";
}

}  // namespace

QueryService::QueryService(const AddOnContext& node, std::function<void()> meanwhile)
    : live_(node.live),
      meanwhile_(std::move(meanwhile)),
      stated_(node, StatedPoseSource::Stamp::kOfRobot),
      self_(node.config) {
  ros::NodeHandle private_nh = node.private_nh;
  private_nh.setCallbackQueue(thread_.queue());
  service_ = private_nh.advertiseService("query", &QueryService::answer, this);
  thread_.start("ist query", [this] {
    return_memory();
    meanwhile_();
  });
}

QueryService::~QueryService() {
  thread_.stop();
  service_.shutdown();
}

/// Bounds the time and the memory of a request.
std::string QueryService::check_size(const Service::Request& request) const {
  const std::size_t states = request.states.size();
  const auto links = static_cast<std::size_t>(std::count(chosen_.begin(), chosen_.end(), true));
  const std::size_t pairs = request.self_proximity != 0 ? self_.size() : 0;
  if (states <= kMaxAnswers / std::max<std::size_t>(links + pairs, 1)) return "";
  return std::to_string(states) + " states for " + std::to_string(links) + " links" +
         (pairs > 0 ? " and " + std::to_string(pairs) + " pairs" : "") + " are more than " +
         std::to_string(kMaxAnswers) + " answers: ask in several requests, or for fewer links";
}

void QueryService::return_memory() {
  const auto now = std::chrono::steady_clock::now();
  if (now > return_memory_until_ || now < next_return_) return;
  next_return_ = now + std::chrono::seconds(1);
  return_free_memory();
}

bool QueryService::answer(Service::Request& request, Service::Response& response) {
  try {
    response.message = run(request, &response);
    response.success = response.message.empty();
  } catch (const std::exception& error) {  // no memory for a huge request
    response.success = false;
    response.message = error.what();
  }
  if (request.states.size() > kManyStates) {
    return_memory_until_ = std::chrono::steady_clock::now() + kReturnMemoryFor;
  }
  if (!response.success) {
    const std::string message = response.message;
    response = Service::Response();
    response.message = message;
    return true;
  }
  const auto bad =
      std::find_if(response.results.begin(), response.results.end(),
                   [](const ProximityArray& result) { return result.status != result.OK; });
  if (bad != response.results.end()) {
    response.message =
        "results[" + std::to_string(bad - response.results.begin()) + "]: " + bad->status_text;
  }
  return true;
}

/// Chooses the links to answer for.
/// @returns empty, or the name that is not a monitored link
std::string QueryService::choose_links(const std::vector<std::string>& links) {
  const ModelState& model = *stated_.model();
  chosen_.assign(model.links.size(), links.empty());
  for (const std::string& name : links) {
    const auto found = std::find(model.links.begin(), model.links.end(), name);
    if (found == model.links.end()) return "link '" + name + "' is not monitored";
    chosen_[static_cast<std::size_t>(found - model.links.begin())] = true;
  }
  std::vector<bool> wanted = wanted_links(model);
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    if (!chosen_[i]) wanted[model.monitored[i]] = false;
  }
  stated_.poses().set_wanted(wanted);
  return "";
}

std::string QueryService::run(const Service::Request& request, Service::Response* response) {
  std::string problem = check_times(request.times, request.states.size());
  if (problem.empty()) problem = stated_.take_model();
  if (problem.empty()) problem = choose_links(request.links);
  if (problem.empty() && request.self_proximity != 0) problem = stated_.model()->rules_problem;
  if (problem.empty() && request.self_proximity != 0) {
    self_.set_model(stated_.model());
    self_.choose(chosen_);
  }
  if (problem.empty()) problem = check_size(request);
  if (!problem.empty()) return problem;

  LiveConfig live = live_();
  live.query.deadline = 0.0;
  std::vector<std::vector<double>> positions;
  for (std::size_t i = 0; i < request.states.size(); ++i) {
    response->results.emplace_back();
    ProximityArray& result = response->results.back();
    problem = stated_.run(request.states[i], live, &result);
    if (!problem.empty()) return "states[" + std::to_string(i) + "]: " + problem;
    positions.push_back(stated_.poses().positions());
    if (request.self_proximity != 0) self_.add(stated_.poses(), live.query, &response->pairs);
    for (std::size_t link = chosen_.size(); link-- > 0;) {
      if (!chosen_[link]) result.links.erase(result.links.begin() + static_cast<long>(link));
    }
    meanwhile_();
    if (!thread_.is_running()) return "the node ends";
  }
  if (request.times.empty()) return "";
  return find_impact_times(request, positions, live.query, response);
}

namespace {

/// @returns empty, or which joint is stated at one end of the motion only
std::string half_stated_joint(const std::vector<Kinematics::Joint>& joints,
                              const JointMotion& motion, std::size_t state) {
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (std::isnan(motion.from[j]) == std::isnan(motion.to[j])) continue;
    return "joint '" + joints[j].name + "' is stated in one of states[" + std::to_string(state) +
           "] and states[" + std::to_string(state + 1) + "] only: a motion has to state it in all";
  }
  return "";
}

/// Keeps the first contact of each link, or NaN where it is not known.
/// @param begin  [s] of the part of the motion that the impacts are found in
void note_impacts(const std::vector<ImpactTime>& impacts, double begin, std::vector<double>* first,
                  std::vector<bool>* wanted) {
  for (std::size_t i = 0; i < wanted->size(); ++i) {
    if (std::isfinite(impacts[i].time)) {
      (*first)[i] = begin + impacts[i].time;
      (*wanted)[i] = false;  // the request asks for the first contact only
    } else if (std::isnan(impacts[i].time) && (*first)[i] == kInfinity) {
      (*first)[i] = impacts[i].time;
      (*wanted)[i] = false;
    }
  }
}

}  // namespace

/// Finds the times of impact with the obstacles of the last result, straight from state to state.
/// @returns empty, or why the motion cannot be answered
std::string QueryService::find_impact_times(const Service::Request& request,
                                            const std::vector<std::vector<double>>& positions,
                                            const QueryConfig& query, Service::Response* response) {
  const ModelState& model = *stated_.model();
  const StatedPoseSource& poses = stated_.poses();
  std::vector<bool> wanted = stated_.measurable();
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    if (!chosen_[i]) wanted[model.monitored[i]] = false;
  }
  std::vector<double> first;
  first.reserve(wanted.size());
  for (const bool one : wanted) first.push_back(one ? kInfinity : std::nan(""));
  if (request.self_proximity != 0) self_.begin_motion();
  JointPoses still;  // empty while nothing is known of the motion
  if (poses.is_motion_known()) still = poses.joints();
  TimeOfImpact& times = stated_.impacts(query);
  std::vector<ImpactTime> impacts;
  for (std::size_t k = 0; k + 1 < positions.size(); ++k) {
    const JointMotion motion{positions[k], positions[k + 1],
                             request.times[k + 1] - request.times[k]};
    std::string half_stated = half_stated_joint(model.kinematics->joints(), motion, k);
    if (!half_stated.empty()) return half_stated;
    times.run(motion, poses.joints(), poses.X_FR(), wanted, stated_.cycle().clouds(),
              stated_.cycle().worlds(), &impacts);
    if (request.self_proximity != 0) self_.advance(motion, request.times[k], still, query);
    note_impacts(impacts, request.times[k], &first, &wanted);
    meanwhile_();
    if (!thread_.is_running()) return "the node ends";
  }
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    if (!chosen_[i]) continue;
    response->impact_links.push_back(model.links[i]);
    response->impact_times.push_back(first[model.monitored[i]]);
  }
  if (request.self_proximity != 0) response->pair_impact_times = self_.impact_times();
  return "";
}

}  // namespace ist
