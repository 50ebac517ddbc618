#include "ros/parameters/live_parameters.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/this_node.h>

#include <algorithm>
#include <sstream>

#include "ros/common/publish.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_table.h"

namespace ist {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;
using dynamic_reconfigure::Reconfigure;
using XmlRpc::XmlRpcValue;

constexpr char kKept[] = "the last valid ~query, ~repulsion and ~speed_scale stay in use: ";
constexpr std::chrono::seconds kRepeatLog(30), kPatience(3);

/// A group is a dictionary, without the dictionaries in it.
std::vector<Parameter> rows_of(const std::string& group, ServerConfig* config) {
  std::vector<Parameter> rows;
  for (const Parameter& row : live_parameters(config)) {
    if (row.name.compare(0, row.name.rfind('/'), group) == 0) rows.push_back(row);
  }
  return rows;
}

std::string name_in_group(const Parameter& row) { return row.name.substr(row.name.rfind('/') + 1); }

void add_number(const Parameter& row, double number, Config* config) {
  const auto add = [&row, number](auto* list) {
    list->emplace_back();
    list->back().name = name_in_group(row);
    list->back().value = static_cast<decltype(list->back().value)>(number);
  };
  row.is_bool() ? add(&config->bools) : add(&config->doubles);
  config->groups.resize(1);
  config->groups[0].name = "Default";
  config->groups[0].state = true;
}

/// A value that is set is not cut off.
ConfigDescription describe(const std::vector<Parameter>& defaults,
                           const std::vector<Parameter>& live, double max_distance) {
  ConfigDescription all;
  all.groups.resize(1);
  all.groups[0].name = "Default";
  for (std::size_t i = 0; i < defaults.size(); ++i) {
    const Parameter& row = defaults[i];
    const double end = row.slider > 0.0 ? row.slider : max_distance;
    add_number(row, row.number(), &all.dflt);
    add_number(row, row.range.min, &all.min);
    add_number(row, std::max(live[i].number(), end), &all.max);
    dynamic_reconfigure::ParamDescription one;
    one.name = name_in_group(row);
    one.type = row.is_bool() ? "bool" : "double";
    const std::string unit = row.range.unit;
    one.description = "~" + row.name + (unit.empty() ? ": " : " [" + unit + "]: ") + row.help;
    all.groups[0].parameters.push_back(one);
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
  ServerConfig defaults;
  defaults.query.max_distance = config.query.max_distance;
  defaults.speed_scale = fitted_to(defaults.speed_scale, config.query.max_distance);
  defaults = parse_live(XmlRpcValue(), defaults).config;  // the influence distance fits, too
  {
    const std::lock_guard<std::mutex> lock(change_mutex_);
    for (Group& group : groups_) advertise(&defaults, &group);
  }
  read_again();
  timer_ = private_nh_.createSteadyTimer(ros::WallDuration(1.0),
                                         [this](const ros::SteadyTimerEvent&) { read_again(); });
}

void LiveParameters::advertise(ServerConfig* defaults, Group* group) {
  const std::string name = group->name;
  ros::NodeHandle nh(private_nh_, name);
  group->descriptions = nh.advertise<ConfigDescription>("parameter_descriptions", 1, true);
  publish_message(group->descriptions, describe(rows_of(name, defaults), rows_of(name, &live_),
                                                live_.query.max_distance));
  group->updates = nh.advertise<Config>("parameter_updates", 1, true);
  group->service = nh.advertiseService<Reconfigure::Request, Reconfigure::Response>(
      "set_parameters",
      [this, group](Reconfigure::Request& request, Reconfigure::Response& response) {
        return set(group, request.config, &response.config);
      });
}

ServerConfig LiveParameters::config() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  return live_;
}

LiveConfig LiveParameters::get() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  return live_;
}

std::string LiveParameters::problem() const {
  const std::lock_guard<std::mutex> lock(live_mutex_);
  const std::chrono::duration<double> waits = Clock::now() - asked_;
  if (asked_ != Clock::time_point() && waits > kPatience) {
    return kKept + format_text("the parameter server has not answered for %.0f s", waits.count());
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
  const LiveReading reading = parse_live(*tree, config());
  take(reading);
  note_startup_changes(*tree);
  std::vector<std::string> problems = reading.errors;
  if (const std::string lost = lost_names(reading.found); !lost.empty()) problems.push_back(lost);
  set_problem(join(problems, "; "));
  return true;
}

/// Says which parameters have changed, or come, that are read at the start only. What is gone from
/// the server is not named: it is still in use. The caller holds change_mutex_.
void LiveParameters::note_startup_changes(const XmlRpcValue& tree) {
  Values now = leaves_of(tree);
  ServerConfig live = config();
  for (const Parameter& row : live_parameters(&live)) now.erase(row.name);
  if (!at_start_) at_start_ = now;
  std::vector<std::string> changes;
  for (const auto& [name, value] : now) {
    const auto before = at_start_->find(name);
    const std::string text = text_of(value);
    if (before == at_start_->end()) {
      changes.push_back("~" + name + " has been set to " + text);
    } else if (const std::string in_use = text_of(before->second); in_use != text) {
      changes.push_back("~" + name + " is " + text + ", in use is " + in_use);
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
std::string LiveParameters::lost_names(const std::set<std::string>& found) const {
  ServerConfig live = config();
  std::vector<std::string> names;
  for (const Parameter& row : live_parameters(&live)) {
    if (configured_.count(row.name) == 0 || found.count(row.name) > 0) continue;
    names.push_back("~" + row.name + " (" + with_unit(number_text(row.number()), row.range) + ")");
  }
  if (names.empty()) return "";
  return "no longer on the parameter server: " + join(names, ", ") +
         "; set them again, or restart the node for the defaults";
}

/// The caller holds change_mutex_.
void LiveParameters::set_problem(const std::string& problem) {
  const std::string text = problem.empty() ? "" : kKept + problem;
  std::string before = text;
  {
    const std::lock_guard<std::mutex> lock(live_mutex_);
    before.swap(problem_);
  }
  if (!text.empty()) return log(text);
  if (!before.empty()) ROS_INFO("the live parameters are those of the server again");
}

/// The caller holds change_mutex_.
void LiveParameters::take(const LiveReading& reading) {
  configured_.insert(reading.found.begin(), reading.found.end());
  const std::lock_guard<std::mutex> lock(live_mutex_);
  live_ = reading.config;
}

/// Applies a request on top of the parameter server's values, entirely or not at all.
/// @returns false when it names something else, or the parameter server does not answer
bool LiveParameters::set(Group* group, const Config& wanted, Config* answer) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  Values change;
  for (const auto& one : wanted.doubles) change[one.name] = one.value;
  for (const auto& one : wanted.ints) change[one.name] = one.value;
  for (const auto& one : wanted.bools) change[one.name] = XmlRpcValue(one.value != 0);
  for (const auto& one : wanted.strs) change[one.name] = one.value;
  ServerConfig live = config();
  std::set<std::string> names;
  for (const Parameter& row : rows_of(group->name, &live)) names.insert(name_in_group(row));
  for (const auto& one : change) {
    if (names.count(one.first) > 0) continue;
    log("a request to " + private_nh_.getNamespace() + "/" + group->name +
        "/set_parameters is refused: '" + one.first + "' is none of its parameters");
    return false;
  }
  const bool answered = read_server() && apply(group->name, change);
  if (answered) publish_updates();
  *answer = group->published;  // the values in use
  return answered;
}

/// Writes the change to the parameter server and takes it; refuses what is wrong. The caller holds
/// change_mutex_.
/// @returns false when the parameter server does not take it
bool LiveParameters::apply(const std::string& group, const Values& change) {
  XmlRpcValue tree;
  XmlRpcValue* members = &tree;
  std::istringstream path(group);
  for (std::string part; std::getline(path, part, '/');) members = &(*members)[part];
  for (const auto& [name, value] : change) (*members)[name] = value;
  const LiveReading reading = parse_live(tree, config());
  if (!reading.errors.empty()) {
    log(kKept + join(reading.errors, "; "));
    return true;
  }
  for (const auto& [name, value] : change) {
    const std::string full = group + "/" + name;
    if (write(private_nh_.resolveName(full), value)) continue;
    set_problem("the parameter server does not take ~" + full);
    return false;
  }
  take(reading);
  return true;
}

/// The response has no place for the reason of a refusal. The caller holds change_mutex_.
void LiveParameters::log(const std::string& text) {
  const Clock::time_point now = Clock::now();
  if (text == logged_ && now - logged_time_ < kRepeatLog) return;
  logged_ = text;
  logged_time_ = now;
  ROS_WARN_STREAM(text);
}

void LiveParameters::publish_updates() {
  ServerConfig live = config();
  for (Group& group : groups_) {
    Config now;
    for (const Parameter& row : rows_of(group.name, &live)) add_number(row, row.number(), &now);
    if (now == group.published) continue;
    group.published = now;
    publish_message(group.updates, now);
  }
}

}  // namespace ist
