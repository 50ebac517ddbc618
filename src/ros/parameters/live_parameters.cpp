#include "ros/parameters/live_parameters.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/console.h>
#include <ros/serialization.h>

namespace ist {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;
using dynamic_reconfigure::Reconfigure;

constexpr char kOnlyGroup[] = "Default";

/// Gives the part of a tunable's name after "GROUP/"; empty for a tunable of another group.
std::string name_within(const std::string& group, const Tunable& tunable) {
  const std::string prefix = group + "/";
  return tunable.name.compare(0, prefix.size(), prefix) == 0 ? tunable.name.substr(prefix.size())
                                                             : std::string();
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

ConfigDescription describe(const std::string& group, const std::vector<Tunable>& tunables) {
  ConfigDescription description;
  description.min = config_of(group, tunables, [](const Tunable& t) { return t.range.min; });
  description.max = config_of(group, tunables, [](const Tunable& t) { return t.range.max; });
  description.dflt = config_of(group, tunables, [](const Tunable& t) { return t.default_value; });
  dynamic_reconfigure::Group only;
  only.name = kOnlyGroup;
  for (const Tunable& tunable : tunables) {
    dynamic_reconfigure::ParamDescription parameter;
    parameter.name = name_within(group, tunable);
    if (parameter.name.empty()) continue;
    parameter.type = type_name(tunable.kind);
    parameter.description = "~" + tunable.name;
    if (*tunable.range.unit) parameter.description += std::string(" [") + tunable.range.unit + "]";
    only.parameters.push_back(parameter);
  }
  description.groups.push_back(only);
  return description;
}

void warn_of_refusal(const std::string& reason) {
  ROS_WARN_STREAM_THROTTLE(
      5.0, "the last valid ~query, ~repulsion and ~penetration stay in use: " << reason);
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
      max_distance_(config.query.max_distance),
      live_{config.query, config.repulsion, config.penetration, nullptr} {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  parse_live(XmlRpc::XmlRpcValue(), max_distance_, &tunables_);  // names and ranges
  for (const char* name : {"query", "repulsion", "penetration"}) advertise(name);
  apply({});
}

void LiveParameters::advertise(const std::string& name) {
  groups_.push_back(std::make_unique<Group>());
  Group* group = groups_.back().get();
  group->name = name;
  ros::NodeHandle nh(private_nh_, name);
  group->descriptions = nh.advertise<ConfigDescription>("parameter_descriptions", 1, true);
  group->descriptions.publish(describe(name, tunables_));
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

void LiveParameters::read_again() {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  apply({});
}

bool LiveParameters::set(Group* group, const Reconfigure::Request& request,
                         Reconfigure::Response& response) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  Change change;
  const std::string prefix = group->name + "/";
  for (const auto& one : request.config.doubles) change[prefix + one.name] = one.value;
  for (const auto& one : request.config.ints) change[prefix + one.name] = one.value;
  for (const auto& one : request.config.bools) {
    change[prefix + one.name] = XmlRpc::XmlRpcValue(static_cast<bool>(one.value));
  }
  for (const auto& one : request.config.strs) change[prefix + one.name] = one.value;
  apply(change);
  response.config = group->published;
  return true;
}

/// Applies the change on top of the parameter server's values, entirely or not at all. The caller
/// holds change_mutex_.
void LiveParameters::apply(const Change& change) {
  std::vector<Tunable> tunables;
  try {
    XmlRpc::XmlRpcValue tree = fetch_parameters(private_nh_);
    for (const auto& [name, value] : change) {
      const std::size_t slash = name.find('/');
      tree[name.substr(0, slash)][name.substr(slash + 1)] = value;
    }
    const LiveConfig live = parse_live(tree, max_distance_, &tunables);
    for (const auto& [name, value] : change) private_nh_.setParam(name, value);
    const std::lock_guard<std::mutex> lock(live_mutex_);
    live_ = live;
  } catch (const ParameterError& error) {
    return warn_of_refusal(error.what());
  } catch (const XmlRpc::XmlRpcException& error) {
    return warn_of_refusal(error.getMessage());
  }
  tunables_ = std::move(tunables);
  publish_updates();
}

void LiveParameters::publish_updates() {
  for (const auto& group : groups_) {
    const Config now = values_of(group->name, tunables_);
    if (same(now, group->published)) continue;
    group->published = now;
    group->updates.publish(now);
  }
}

}  // namespace ist
