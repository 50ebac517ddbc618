#include "ros/parameters/live_parameters.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/this_node.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <utility>

#include "ros/common/publish.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;
using dynamic_reconfigure::Reconfigure;
using XmlRpc::XmlRpcValue;

constexpr char kOnlyGroup[] = "Default";
constexpr const char* kGroups[] = {"query", "repulsion", "penetration", "speed_scale",
                                   "speed_scale/separation"};
constexpr char kKept[] =
    "the last valid ~query, ~repulsion, ~penetration and ~speed_scale stay in use: ";
constexpr std::chrono::seconds kRepeatLog(30), kPatience(3);

/// The rows of a group, by the rest of their names; those of a group below are not among them.
std::vector<std::pair<std::string, Parameter>> rows_of(const std::string& group,
                                                       LiveConfig* config) {
  std::vector<std::pair<std::string, Parameter>> rows;
  for (const Parameter& parameter : live_parameters(config)) {
    const std::size_t slash = parameter.name.rfind('/');
    if (parameter.name.compare(0, slash, group) != 0) continue;
    rows.emplace_back(parameter.name.substr(slash + 1), parameter);
  }
  return rows;
}

/// One number of each parameter of a group.
template <class Number>
Config config_of(const std::string& group, LiveConfig live, Number number) {
  Config config;
  for (const auto& [name, parameter] : rows_of(group, &live)) {
    if (parameter.is_bool()) {
      config.bools.emplace_back();
      config.bools.back().name = name;
      config.bools.back().value = number(parameter) != 0.0;
    } else {
      config.doubles.emplace_back();
      config.doubles.back().name = name;
      config.doubles.back().value = number(parameter);
    }
  }
  config.groups.emplace_back();
  config.groups.back().name = kOnlyGroup;
  config.groups.back().state = true;
  return config;
}

Config values_of(const std::string& group, const LiveConfig& live) {
  return config_of(group, live, [](const Parameter& parameter) { return parameter.number(); });
}

ConfigDescription describe(const std::string& group, LiveConfig defaults, const LiveConfig& live) {
  const double max_distance = live.query.max_distance;
  ConfigDescription all;
  all.dflt = values_of(group, defaults);
  all.min = config_of(group, defaults, [](const Parameter& one) { return one.range.min; });
  all.max = config_of(group, live, [max_distance](const Parameter& one) {
    const double end = std::min(one.range.max, one.slider > 0.0 ? one.slider : max_distance);
    return std::max(end, one.number());  // a value that is set must not be cut off
  });
  for (std::size_t i = 0; i < all.max.doubles.size(); ++i) {
    double& end = all.max.doubles[i].value;
    end = std::max(end, all.dflt.doubles[i].value);
  }
  all.groups.emplace_back();
  all.groups.back().name = kOnlyGroup;
  for (const auto& [name, parameter] : rows_of(group, &defaults)) {
    dynamic_reconfigure::ParamDescription one;
    one.name = name;
    one.type = parameter.is_bool() ? "bool" : "double";
    const std::string unit = parameter.range.unit;
    one.description = "~" + parameter.name + (unit.empty() ? ": " : " [" + unit + "]: ");
    one.description += parameter.help;
    all.groups.back().parameters.push_back(one);
  }
  return all;
}

/// Writes to the parameter server; ros::param::set() would wait for a master that does not answer.
bool write(const std::string& name, const XmlRpcValue& value) {
  XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = name;
  request[2] = value;
  return ros::master::execute("setParam", request, response, payload, false);
}

std::string path_of(const std::string& group, const std::string& name) {
  return group + "/" + name;
}

/// @param before  the value in use; null: it was not set
std::string change_text(const std::string& name, const std::string& value,
                        const std::string* before) {
  if (before == nullptr) return "~" + name + " has been set to " + value;
  return "~" + name + " is " + value + ", in use is " + *before;
}

std::string text_of(const XmlRpcValue& value) {
  if (value.getType() == XmlRpcValue::TypeDouble) {
    return number_text(static_cast<const double&>(value));
  }
  std::ostringstream text;
  text << value;
  return text.str();
}

}  // namespace

LiveParameters::LiveParameters(const ros::NodeHandle& private_nh, const ServerConfig& config)
    : private_nh_(private_nh), live_(config) {
  configured_.assign(live_parameters(&live_).size(), false);
  lost_ = configured_;
  LiveConfig defaults;
  defaults.query.max_distance = config.query.max_distance;
  defaults.speed_scale = fitted_to(defaults.speed_scale, config.query.max_distance);
  defaults = parse_live(XmlRpcValue(), defaults).config;  // the influence distance fits, too
  {
    const std::lock_guard<std::mutex> lock(change_mutex_);
    for (const char* name : kGroups) advertise(name, defaults);
  }
  read_again();
  timer_ = private_nh_.createSteadyTimer(ros::WallDuration(1.0),
                                         [this](const ros::SteadyTimerEvent&) { read_again(); });
}

void LiveParameters::advertise(const std::string& name, const LiveConfig& defaults) {
  groups_.push_back(std::make_unique<Group>());
  Group* group = groups_.back().get();
  group->name = name;
  ros::NodeHandle nh(private_nh_, name);
  group->descriptions = nh.advertise<ConfigDescription>("parameter_descriptions", 1, true);
  publish_message(group->descriptions, describe(name, defaults, live_));
  group->updates = nh.advertise<Config>("parameter_updates", 1, true);
  group->service = nh.advertiseService<Reconfigure::Request, Reconfigure::Response>(
      "set_parameters",
      [this, group](Reconfigure::Request& request, Reconfigure::Response& response) {
        return set(group, request.config, &response.config);
      });
}

LiveConfig LiveParameters::get() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  return live_;
}

std::string LiveParameters::problem() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  const auto waits = Clock::now() - asked_;
  if (asked_ != Clock::time_point() && waits > kPatience) {
    const double seconds = std::chrono::duration<double>(waits).count();
    return kKept + format_text("the parameter server has not answered for %.0f s", seconds);
  }
  return problem_;
}

std::string LiveParameters::without_effect() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  return without_effect_;
}

void LiveParameters::read_again() {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  if (read_server()) publish_updates();
}

/// Takes what is valid on the parameter server. The caller holds change_mutex_.
/// @returns false when the server does not answer
bool LiveParameters::read_server() {
  const auto note_asked = [this](Clock::time_point when) {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    asked_ = when;
  };
  note_asked(Clock::now());
  const std::optional<XmlRpcValue> tree = fetch_parameters(private_nh_);
  note_asked({});
  if (!tree) {
    set_problem("the parameter server at " + ros::master::getURI() + " does not answer");
    return false;
  }
  const LiveReading reading = parse_live(*tree, get());
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    lost_[i] = configured_[i] && !reading.found[i];
    configured_[i] = configured_[i] || reading.found[i];
  }
  take(reading.config);
  note_startup_changes(*tree);
  std::vector<std::string> problems = reading.errors;
  if (const std::string lost = lost_names(); !lost.empty()) problems.push_back(lost);
  set_problem(join(problems, "; "));
  return true;
}

/// Says which parameters have changed, or come, that are read at the start only. What is gone from
/// the server is not named: it is still in use. The caller holds change_mutex_.
void LiveParameters::note_startup_changes(const XmlRpcValue& tree) {
  std::map<std::string, XmlRpcValue> now = leaves_of(tree);
  LiveConfig live = get();
  for (const Parameter& parameter : live_parameters(&live)) now.erase(parameter.name);
  if (!at_start_) at_start_ = now;
  std::vector<std::string> changes;
  for (const auto& [name, value] : now) {
    const auto before = at_start_->find(name);
    const std::string text = text_of(value);
    const bool is_new = before == at_start_->end();
    const std::string in_use = is_new ? "" : text_of(before->second);
    if (is_new || in_use != text) {
      changes.push_back(change_text(name, text, is_new ? nullptr : &in_use));
    }
  }
  std::string sentence = join(changes, "; ");
  if (!changes.empty()) {
    sentence = "read at the start only, so that the node has to be restarted: " + sentence;
  }
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    if (sentence == without_effect_) return;
    without_effect_ = sentence;
  }
  if (!sentence.empty()) ROS_WARN_STREAM(sentence);
}

/// Names the parameters that have gone from the server, with the values in use.
std::string LiveParameters::lost_names() const {
  LiveConfig live = get();
  const std::vector<Parameter> table = live_parameters(&live);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    if (!lost_[i]) continue;
    names.push_back("~" + table[i].name + " (" +
                    with_unit(number_text(table[i].number()), table[i].range) + ")");
  }
  if (names.empty()) return "";
  return "no longer on the parameter server: " + join(names, ", ") +
         "; set them again, or restart the node for the defaults";
}

/// The caller holds change_mutex_.
void LiveParameters::set_problem(const std::string& problem) {
  const std::string text = problem.empty() ? "" : kKept + problem;
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    problem_ = text;
  }
  const auto now = Clock::now();
  if (text.empty()) {
    if (!logged_problem_.empty()) ROS_INFO("the live parameters are those of the server again");
  } else if (text != logged_problem_ || now - logged_time_ > kRepeatLog) {
    ROS_WARN_STREAM(text);
    logged_time_ = now;
  }
  logged_problem_ = text;
}

void LiveParameters::take(const LiveConfig& config) {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  live_ = config;
}

bool LiveParameters::set(Group* group, const Config& wanted, Config* answer) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  std::map<std::string, XmlRpcValue> change;
  for (const auto& one : wanted.doubles) change[one.name] = one.value;
  for (const auto& one : wanted.ints) change[one.name] = one.value;
  for (const auto& one : wanted.bools) change[one.name] = XmlRpcValue(one.value != 0);
  for (const auto& one : wanted.strs) change[one.name] = one.value;
  LiveConfig live = get();
  const auto rows = rows_of(group->name, &live);
  for (const auto& one : change) {
    const auto is_this = [&one](const auto& row) { return row.first == one.first; };
    if (std::any_of(rows.begin(), rows.end(), is_this)) continue;
    ROS_WARN_STREAM_THROTTLE(5.0, "a request to " << private_nh_.getNamespace() << "/"
                                                  << group->name << "/set_parameters is refused: '"
                                                  << "~" << group->name << "/" << one.first
                                                  << "' is none of its parameters");
    return false;
  }
  const bool answered = apply(group->name, change);
  *answer = group->published;
  return answered;
}

/// Applies the change on top of the parameter server's values, entirely or not at all. The caller
/// holds change_mutex_.
/// @param change  values by name in the group; may be empty
/// @returns false when the parameter server does not answer; then nothing changes
bool LiveParameters::apply(const std::string& group,
                           const std::map<std::string, XmlRpcValue>& change) {
  if (!read_server()) return false;
  XmlRpcValue tree;
  for (const auto& [name, value] : change) {
    XmlRpcValue* place = &tree;
    std::istringstream path(path_of(group, name));
    for (std::string part; std::getline(path, part, '/');) place = &(*place)[part];
    *place = value;
  }
  const LiveReading reading = parse_live(tree, get());
  if (!reading.errors.empty()) {
    ROS_WARN_STREAM_THROTTLE(5.0, kKept << join(reading.errors, "; "));
    publish_updates();
    return true;  // the response holds the values in use
  }
  for (const auto& [name, value] : change) {
    const std::string full = path_of(group, name);
    if (write(private_nh_.resolveName(full), value)) continue;
    set_problem("the parameter server does not take ~" + full);
    return false;
  }
  for (std::size_t i = 0; i < configured_.size(); ++i) {
    configured_[i] = configured_[i] || reading.found[i];
  }
  take(reading.config);
  publish_updates();
  return true;
}

void LiveParameters::publish_updates() {
  for (const auto& group : groups_) {
    const Config now = values_of(group->name, get());
    if (now == group->published) continue;
    group->published = now;
    publish_message(group->updates, now);
  }
}

}  // namespace ist
