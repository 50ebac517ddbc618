#include "ros/parameters/live_parameters.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/serialization.h>
#include <ros/this_node.h>

#include <algorithm>
#include <optional>

#include "ros/common/publish.h"
#include "ros/common/text.h"
#include "ros/common/thread_name.h"
#include "ros/parameters/slider.h"

namespace ist {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;
using dynamic_reconfigure::Reconfigure;

constexpr char kOnlyGroup[] = "Default";

constexpr const char* kGroups[] = {"query", "repulsion", "penetration", "speed_scale",
                                   "speed_scale/separation"};

/// Gives the part of a tunable's name after "GROUP/"; empty for a tunable of another group, and of
/// one below.
std::string name_within(const std::string& group, const Tunable& tunable) {
  const std::string prefix = group + "/";
  const bool is_below = tunable.name.compare(0, prefix.size(), prefix) == 0 &&
                        tunable.name.find('/', prefix.size()) == std::string::npos;
  return is_below ? tunable.name.substr(prefix.size()) : std::string();
}

/// A tree that holds a value at a path with slashes.
XmlRpc::XmlRpcValue at_path(const std::string& path, const XmlRpc::XmlRpcValue& value) {
  XmlRpc::XmlRpcValue tree;
  const std::size_t slash = path.find('/');
  if (slash == std::string::npos) {
    tree[path] = value;
  } else {
    tree[path.substr(0, slash)] = at_path(path.substr(slash + 1), value);
  }
  return tree;
}

template <class Parameter, class Value>
void append(const std::string& name, Value value, std::vector<Parameter>* list) {
  Parameter parameter;
  parameter.name = name;
  parameter.value = static_cast<decltype(parameter.value)>(value);
  list->push_back(parameter);
}

void append(const std::string& name, Tunable::Kind kind, double value, Config* config) {
  switch (kind) {
    case Tunable::Kind::kDouble:
      return append(name, value, &config->doubles);
    case Tunable::Kind::kInt:
      return append(name, value, &config->ints);
    case Tunable::Kind::kBool:
      return append(name, value, &config->bools);
  }
}

const char* type_name(Tunable::Kind kind) {
  switch (kind) {
    case Tunable::Kind::kInt:
      return "int";
    case Tunable::Kind::kBool:
      return "bool";
    case Tunable::Kind::kDouble:
      break;
  }
  return "double";
}

/// Describes all parameters of a group by one of their numbers: value, default, minimum, maximum.
template <class Number>
Config config_of(const std::string& group, const std::vector<Tunable>& tunables, Number number) {
  Config config;
  for (const Tunable& tunable : tunables) {
    const std::string name = name_within(group, tunable);
    if (!name.empty()) append(name, tunable.kind, number(tunable), &config);
  }
  dynamic_reconfigure::GroupState state;
  state.name = kOnlyGroup;
  state.state = true;
  config.groups.push_back(state);
  return config;
}

Config values_of(const std::string& group, const std::vector<Tunable>& tunables) {
  return config_of(group, tunables, [](const Tunable& tunable) { return tunable.value; });
}

ConfigDescription describe(const std::string& group, const std::vector<Tunable>& tunables,
                           double max_distance) {
  ConfigDescription description;
  description.min = config_of(group, tunables, [](const Tunable& t) { return t.range.min; });
  description.max = config_of(
      group, tunables, [max_distance](const Tunable& t) { return slider_of(t, max_distance).max; });
  description.dflt = config_of(group, tunables, [](const Tunable& t) { return t.default_value; });
  dynamic_reconfigure::Group only;
  only.name = kOnlyGroup;
  for (const Tunable& tunable : tunables) {
    dynamic_reconfigure::ParamDescription parameter;
    parameter.name = name_within(group, tunable);
    if (parameter.name.empty()) continue;
    parameter.type = type_name(tunable.kind);
    parameter.description = slider_of(tunable, max_distance).tooltip;
    only.parameters.push_back(parameter);
  }
  description.groups.push_back(only);
  return description;
}

constexpr char kKept[] =
    "the last valid ~query, ~repulsion, ~penetration and ~speed_scale stay in use: ";
constexpr std::chrono::seconds kRepeatLog(30), kPatience(3);

/// Names the first member of a request that is no parameter of the group.
/// @returns empty when all are
template <class Parameters>
std::string unknown_name(const std::string& group, const std::vector<Tunable>& tunables,
                         const Parameters& parameters) {
  for (const auto& parameter : parameters) {
    const bool known = std::any_of(tunables.begin(), tunables.end(), [&](const Tunable& tunable) {
      return !parameter.name.empty() && name_within(group, tunable) == parameter.name;
    });
    if (!known) return "~" + group + "/" + parameter.name;
  }
  return "";
}

/// Writes to the parameter server; ros::param::set() would wait for a master that does not answer.
bool write(const std::string& name, const XmlRpc::XmlRpcValue& value) {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = name;
  request[2] = value;
  return ros::master::execute("setParam", request, response, payload, false);
}

bool same(const Config& a, const Config& b) {
  const auto bytes = [](const Config& config) {
    const ros::SerializedMessage message = ros::serialization::serializeMessage(config);
    return std::vector<std::uint8_t>(message.buf.get(), message.buf.get() + message.num_bytes);
  };
  return bytes(a) == bytes(b);
}

}  // namespace

LiveParameters::LiveParameters(const ros::NodeHandle& private_nh, const ServerConfig& config)
    : private_nh_(private_nh),
      live_{config.query, config.repulsion, config.penetration, config.speed_scale, nullptr} {
  {
    const std::lock_guard<std::mutex> lock(change_mutex_);
    LiveConfig defaults;
    defaults.query.max_distance = config.query.max_distance;
    defaults.speed_scale = fitted_to(defaults.speed_scale, config.query.max_distance);
    defaults.speed_scale.links = config.speed_scale.links;
    tunables_ = parse_live(XmlRpc::XmlRpcValue(), defaults).tunables;  // names, ranges, defaults
    const std::vector<Tunable> in_use = parse_live(XmlRpc::XmlRpcValue(), live_).tunables;
    for (std::size_t i = 0; i < tunables_.size(); ++i) tunables_[i].value = in_use[i].value;
    configured_.assign(tunables_.size(), false);
    lost_ = configured_;
    for (const char* name : kGroups) advertise(name);
  }
  read_again();
  thread_ = std::thread(&LiveParameters::run, this);
}

LiveParameters::~LiveParameters() {
  stop_signal_.stop();
  thread_.join();
}

void LiveParameters::run() {
  name_thread("ist parameters");
  while (stop_signal_.sleep_until(Clock::now() + std::chrono::seconds(1))) read_again();
}

void LiveParameters::advertise(const std::string& name) {
  groups_.push_back(std::make_unique<Group>());
  Group* group = groups_.back().get();
  group->name = name;
  ros::NodeHandle nh(private_nh_, name);
  group->descriptions = nh.advertise<ConfigDescription>("parameter_descriptions", 1, true);
  publish_message(group->descriptions, describe(name, tunables_, live_.query.max_distance));
  group->updates = nh.advertise<Config>("parameter_updates", 1, true);
  group->service = nh.advertiseService<Reconfigure::Request, Reconfigure::Response>(
      "set_parameters",
      [this, group](Reconfigure::Request& request, Reconfigure::Response& response) {
        return set(group, request, response);
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
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    asked_ = Clock::now();
  }
  const std::optional<XmlRpc::XmlRpcValue> tree = fetch_parameters(private_nh_);
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    asked_ = Clock::time_point();
  }
  if (!tree) {
    set_problem("the parameter server at " + ros::master::getURI() + " does not answer");
    return false;
  }
  const LiveReading reading = parse_live(*tree, get());
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    lost_[i] = configured_[i] && !reading.found[i];
    configured_[i] = configured_[i] || reading.found[i];
  }
  take(reading);
  note_startup_changes(*tree);
  std::vector<std::string> problems = reading.errors;
  if (const std::string lost = lost_names(); !lost.empty()) problems.push_back(lost);
  set_problem(join(problems, "; "));
  return true;
}

/// Says which parameters were changed without effect. The caller holds change_mutex_.
void LiveParameters::note_startup_changes(const XmlRpc::XmlRpcValue& tree) {
  const std::string changes = startup_.changes(tree, tunables_);
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    if (changes == without_effect_) return;
    without_effect_ = changes;
  }
  if (!changes.empty()) ROS_WARN_STREAM(changes);
}

/// Names the parameters that have gone from the server, with the values in use.
std::string LiveParameters::lost_names() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    if (!lost_[i]) continue;
    names.push_back("~" + tunables_[i].name + " (" +
                    with_unit(number_text(tunables_[i].value), tunables_[i].range) + ")");
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

/// The caller holds change_mutex_.
void LiveParameters::take(const LiveReading& reading) {
  for (std::size_t i = 0; i < tunables_.size(); ++i) tunables_[i].value = reading.tunables[i].value;
  const std::lock_guard<std::mutex> lock(live_mutex_);
  live_ = reading.config;
}

bool LiveParameters::set(Group* group, const Reconfigure::Request& request,
                         Reconfigure::Response& response) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  const Config& wanted = request.config;
  std::string unknown = unknown_name(group->name, tunables_, wanted.doubles);
  if (unknown.empty()) unknown = unknown_name(group->name, tunables_, wanted.ints);
  if (unknown.empty()) unknown = unknown_name(group->name, tunables_, wanted.bools);
  if (unknown.empty()) unknown = unknown_name(group->name, tunables_, wanted.strs);
  if (!unknown.empty()) {
    ROS_WARN_STREAM_THROTTLE(5.0, "a request to " << private_nh_.getNamespace() << "/"
                                                  << group->name << "/set_parameters is refused: '"
                                                  << unknown << "' is none of its parameters");
    return false;
  }
  XmlRpc::XmlRpcValue change;
  for (const auto& one : wanted.doubles) change[one.name] = one.value;
  for (const auto& one : wanted.ints) change[one.name] = one.value;
  for (const auto& one : wanted.bools) change[one.name] = XmlRpc::XmlRpcValue(one.value != 0);
  for (const auto& one : wanted.strs) change[one.name] = one.value;
  const bool answered = apply(group->name, change);
  response.config = group->published;
  return answered;
}

/// Applies the change on top of the parameter server's values, entirely or not at all. The caller
/// holds change_mutex_.
/// @param change  values by name in the group; may be empty
/// @returns false when the parameter server does not answer; then nothing changes
bool LiveParameters::apply(const std::string& group, const XmlRpc::XmlRpcValue& change) {
  if (!read_server()) return false;
  if (change.valid()) {
    const LiveReading reading = parse_live(at_path(group, change), get());
    if (!reading.errors.empty()) {
      ROS_WARN_STREAM_THROTTLE(5.0, kKept << join(reading.errors, "; "));
      publish_updates();
      return true;  // the response holds the values in use
    }
    for (const auto& [name, value] : change) {
      std::string path = group;
      path.append("/").append(name);
      if (!write(private_nh_.resolveName(path), value)) {
        set_problem("the parameter server does not take ~" + path);
        return false;
      }
    }
    for (std::size_t i = 0; i < lost_.size(); ++i) {
      configured_[i] = configured_[i] || reading.found[i];
    }
    take(reading);
  }
  publish_updates();
  return true;
}

void LiveParameters::publish_updates() {
  for (const auto& group : groups_) {
    const Config now = values_of(group->name, tunables_);
    if (same(now, group->published)) continue;
    group->published = now;
    publish_message(group->updates, now);
  }
}

}  // namespace ist
