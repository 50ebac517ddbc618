#include "ist_proximity/ros/proximity_server.h"

#include <ros/console.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Float64.h>

#include <algorithm>
#include <boost/make_shared.hpp>

#include "ist_proximity/robot/robot_region.h"
#include "ros/model/object_conversion.h"
#include "ros/output/message_conversion.h"
#include "ros/status/status_log.h"
#include "ros/thread_name.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

// rviz draws no faster
constexpr std::chrono::milliseconds kMarkerPeriod(40);
// Without joint states.
constexpr std::chrono::milliseconds kStatePatience(100);
// After a clock jump.
constexpr std::chrono::seconds kFirstSpheresDelay(1), kLastSpheresDelay(4);
// One marker each.
constexpr std::size_t kMaxSpheresPerLink = 250;

std::string without_leading_slash(const std::string& name) {
  return !name.empty() && name[0] == '/' ? name.substr(1) : name;
}

}  // namespace

ProximityServer::ProximityServer(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                 const ServerConfig& config)
    : config_(config),
      nh_(nh),
      private_nh_(private_nh),
      name_(without_leading_slash(private_nh.getNamespace())),
      buffer_(ros::Duration(10.0)),
      listener_(&buffer_, nh_),
      loader_(config, nh),
      live_(private_nh, config),
      contact_loader_(config, loader_),
      marker_drawer_(config.query.max_distance, std::max(1.0, 3.0 / config.rate)) {
  advertise();
  for (const SourceConfig& source : config_.sources) {
    sources_.push_back(std::make_unique<CloudSource>(source, nh_, buffer_, filtered_cloud_));
  }
  if (config_.pose_source == PoseSourceKind::kJointStates) {
    joint_states_ = std::make_unique<JointStateListener>(&buffer_, nh_, [this] {
      {
        const std::lock_guard<std::mutex> lock(stop_mutex_);
        ++states_come_;
      }
      state_signal_.notify_one();
    });
  }
  const auto live = [this] { return live_config(); };
  query_service_ = std::make_unique<QueryService>(private_nh_, config_, sources_, buffer_, live);
  if (config_.self_collision.enabled) {
    self_proximity_ = std::make_unique<SelfProximity>(nh_, private_nh_, config_, buffer_,
                                                      joint_states_.get(), live);
  }
  cycle_thread_ = std::thread(&ProximityServer::run_cycles, this);
  diagnostics_thread_ = std::thread(&ProximityServer::run_diagnostics, this);
}

ProximityServer::~ProximityServer() {
  {
    const std::lock_guard<std::mutex> lock(stop_mutex_);
    stop_ = true;
  }
  stop_signal_.notify_all();
  state_signal_.notify_all();
  cycle_thread_.join();
  diagnostics_thread_.join();
  query_service_.reset();
  self_proximity_.reset();
  cycle_.reset();
  joint_states_.reset();  // its thread uses members that end before it
}

void ProximityServer::advertise() {
  proximity_ = private_nh_.advertise<ProximityArray>("proximity", 10);
  joint_repulsion_ = private_nh_.advertise<ist_proximity::JointRepulsion>("joint_repulsion", 10);
  min_distance_ = private_nh_.advertise<std_msgs::Float64>("min_distance", 10);
  markers_ = private_nh_.advertise<visualization_msgs::MarkerArray>("markers", 2);
  spheres_ = private_nh_.advertise<visualization_msgs::MarkerArray>("spheres", 1, true);
  filtered_cloud_ = private_nh_.advertise<sensor_msgs::PointCloud2>("filtered_cloud", 2);
  diagnostics_ = nh_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  reload_service_ =
      private_nh_.advertiseService("reload_model", &ProximityServer::reload_model, this);
  attach_service_ =
      private_nh_.advertiseService("attach_object", &ProximityServer::attach_object, this);
  detach_service_ =
      private_nh_.advertiseService("detach_object", &ProximityServer::detach_object, this);
}

bool ProximityServer::sleep_until(Clock::time_point time) {
  std::unique_lock<std::mutex> lock(stop_mutex_);
  return !stop_signal_.wait_until(lock, time, [this] { return stop_; });
}

/// With pose_source joint_states: until one comes; after a while without, all the same. What came
/// during the last cycle is taken at once, one after the other.
bool ProximityServer::wait_for_joint_states() {
  std::unique_lock<std::mutex> lock(stop_mutex_);
  state_signal_.wait_for(lock, kStatePatience,
                         [this] { return stop_ || joint_states_->is_waiting(); });
  joint_states_->take_next();
  return !stop_;
}

void ProximityServer::run_cycles() {
  name_thread("ist cycle");
  if (joint_states_) {
    do {
      run_cycle();
    } while (wait_for_joint_states());
    return;
  }
  const auto period = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / config_.rate));
  Clock::time_point next = Clock::now();
  do {
    run_cycle();
    // A cycle that took too long is not made up for by a burst.
    next = std::max(next + period, Clock::now());
  } while (sleep_until(next));
}

LiveConfig ProximityServer::live_config() const {
  LiveConfig live = live_.get();
  live.contacts = contact_loader_.contacts();
  return live;
}

void ProximityServer::run_cycle() {
  const ros::Time now = ros::Time::now();
  notice_clock_jump(now);
  take_model();
  publish_spheres_again();
  const auto message = boost::make_shared<ProximityArray>();
  const std::string transform_problem = listener_.problem();
  const LiveConfig live = live_config();
  if (live.query.margin != margin_) aim_sources(live.query);
  {
    const std::lock_guard<std::mutex> lock(shared_mutex_);
    report_.transform_problem = transform_problem;
    if (cycle_) {
      cycle_->run(now, sources_, live, message.get(), &report_);
    } else {
      say_no_model(*model_, config_.fixed_frame, now, sources_, message.get(), &report_);
    }
    ++report_.cycles;
  }
  publish(message);
}

/// The sources look after themselves.
void ProximityServer::notice_clock_jump(const ros::Time& now) {
  listener_.notice_clock_jump();
  if (now < last_now_) {
    if (cycle_) cycle_->forget();
    spheres_delay_ = kFirstSpheresDelay;
    spheres_again_ = Clock::now() + spheres_delay_;
  }
  last_now_ = now;
}

/// When the clock jumps back, rviz forgets all markers, some time later and however they were
/// latched.
void ProximityServer::publish_spheres_again() {
  if (Clock::now() < spheres_again_) return;
  spheres_.publish(shown_spheres_);
  spheres_delay_ *= 2;
  spheres_again_ = spheres_delay_ <= kLastSpheresDelay ? Clock::now() + spheres_delay_
                                                       : Clock::time_point::max();
}

void ProximityServer::take_model() {
  std::shared_ptr<const ModelState> model = loader_.state();
  if (model == model_) return;
  model_ = std::move(model);
  if (model_->phase == ModelState::Phase::kReady) {
    cycle_ = std::make_unique<ProximityCycle>(
        model_, config_,
        make_pose_source(*model_, config_, buffer_, joint_states_.get(),
                         JointPoseSource::Which::kTaken),
        ProximityCycle::Reader::kOnly);
  } else {
    cycle_.reset();
  }
  if (joint_states_) {
    listener_.leave_out(model_->kinematics ? computed_frames(*model_->kinematics)
                                           : std::vector<std::string>());
    joint_states_->set_kinematics(model_->kinematics);
  }
  query_service_->set_model(model_);
  if (self_proximity_) self_proximity_->set_model(model_);
  publish_spheres();
  aim_sources(live_.get().query);
}

void ProximityServer::aim_sources(const QueryConfig& query) {
  const std::string fixed_frame = fixed_frame_of(*model_, config_);
  margin_ = query.margin;
  RegionOfInterest region;
  // tf may know better than the URDF where links are.
  const bool computes_poses = config_.pose_source == PoseSourceKind::kJointStates;
  if (computes_poses && model_->robot && model_->kinematics) {
    region = region_of_interest(*model_->robot, *model_->kinematics, fixed_frame,
                                query.max_distance + query.margin);
  }
  for (const auto& source : sources_) source->set_model(model_->robot, fixed_frame, region);
}

void ProximityServer::publish(const ist_proximity::ProximityArrayConstPtr& message) {
  proximity_.publish(message);
  publish_joint_repulsion(*message);
  std_msgs::Float64 smallest;
  smallest.data = min_distance(*message);
  min_distance_.publish(smallest);
  if (markers_.getNumSubscribers() > 0 && Clock::now() >= next_markers_) {
    next_markers_ = Clock::now() + kMarkerPeriod;
    markers_.publish(marker_drawer_.draw(*message));
    const std::lock_guard<std::mutex> lock(shared_mutex_);
    ++report_.markers_drawn;
  }
}

/// The Jacobians are worth computing only while somebody listens.
void ProximityServer::publish_joint_repulsion(const ProximityArray& proximity) {
  if (joint_repulsion_.getNumSubscribers() == 0) return;
  ist_proximity::JointRepulsion message;
  message.header.stamp = proximity.header.stamp;
  message.status = proximity.status;
  message.status_text = proximity.status_text;
  if (cycle_) cycle_->fill_joint_repulsion(proximity, &message);
  joint_repulsion_.publish(message);
}

void ProximityServer::publish_spheres() {
  if (!shown_spheres_.markers.empty()) spheres_.publish(deleted(shown_spheres_));
  shown_spheres_.markers.clear();
  if (!model_->robot) return;
  shown_spheres_ = sphere_markers(*model_->robot, model_->monitored, kMaxSpheresPerLink);
  spheres_.publish(shown_spheres_);
}

void ProximityServer::run_diagnostics() {
  name_thread("ist diagnostics");
  StatusLog status_log;
  std::size_t cycles_before = 0;
  std::uint64_t states_before = 0;
  std::vector<std::uint64_t> messages_before;
  Clock::time_point before = Clock::now();
  while (sleep_until(before + std::chrono::seconds(1))) {
    live_.read_again();
    CycleReport report;
    {
      const std::lock_guard<std::mutex> lock(shared_mutex_);
      report = report_;
    }
    // Before, the loader tells how far it is.
    if (loader_.state()->phase == ModelState::Phase::kReady) {
      status_log.update(report.status, report.text);
    }
    const std::chrono::duration<double> interval = Clock::now() - before;
    before = Clock::now();
    const double rate = static_cast<double>(report.cycles - cycles_before) / interval.count();
    cycles_before = report.cycles;
    double wanted_rate = config_.rate;
    if (joint_states_) {
      report.joint_states = joint_states_->facts();
      const std::lock_guard<std::mutex> lock(stop_mutex_);
      wanted_rate = static_cast<double>(states_come_ - states_before) / interval.count();
      states_before = states_come_;
    }

    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = ros::Time::now();
    messages_before.resize(report.sources.size());
    for (std::size_t i = 0; i < report.sources.size(); ++i) {
      const SourceFacts& source = report.sources[i];
      const auto come = static_cast<double>(source.messages - messages_before[i]);
      messages_before[i] = source.messages;
      message.status.push_back(input_diagnostics(name_, source, report.verdicts[i],
                                                 come / interval.count(),
                                                 message.header.stamp.toSec()));
    }
    message.status.push_back(pose_diagnostics(name_, report));
    message.status.push_back(query_diagnostics(name_, report, rate, wanted_rate));
    message.status.push_back(model_diagnostics(
        name_, *loader_.state(), contact_loader_.contacts().get(), config_.contacts_wanted));
    diagnostics_.publish(message);
  }
}

bool ProximityServer::reload_model(std_srvs::Trigger::Request&,
                                   std_srvs::Trigger::Response& response) {
  bool found = false;
  response.message = loader_.reload(&found);
  response.success = found;
  return true;
}

bool ProximityServer::attach_object(ist_proximity::AttachObject::Request& request,
                                    ist_proximity::AttachObject::Response& response) {
  try {
    response.message = loader_.attach(to_object(request, environment_package_finder()));
  } catch (const std::exception& error) {  // ModelError, or no memory
    response.message = error.what();
  }
  response.success = response.message.empty();
  if (response.success) {
    response.message = "'" + request.name + "' is now part of link '" + request.link + "'";
  }
  return true;
}

bool ProximityServer::detach_object(ist_proximity::DetachObject::Request& request,
                                    ist_proximity::DetachObject::Response& response) {
  response.message = loader_.detach(request.name);
  response.success = response.message.empty();
  if (response.success) response.message = "'" + request.name + "' is detached";
  return true;
}

}  // namespace ist
