// This part of ProximityServer puts the node together, runs the cycle and publishes its results.

#include <ros/console.h>
#include <sensor_msgs/PointCloud2.h>

#include <algorithm>
#include <boost/make_shared.hpp>

#include "ros/common/exceptions.h"
#include "ros/common/frame_name.h"
#include "ros/common/publish.h"
#include "ros/common/stopwatch.h"
#include "ros/common/thread_name.h"
#include "ros/cycle/cycle_message.h"
#include "ros/input/measurement.h"
#include "ros/input/sensor_source.h"
#include "ros/input/world_source.h"
#include "ros/proximity_server_impl.h"

namespace ist {
namespace {

// [s] Where a cycle is rarer than this, the first answer with a new cloud has all the time it
// needs.
constexpr double kLongestWarmPeriod = 0.005;

constexpr std::chrono::milliseconds kMarkerPeriod(40);  // rviz draws no faster

ros::NodeHandle with_queue(ros::NodeHandle nh, CallbackThread* thread) {
  nh.setCallbackQueue(thread->queue());
  return nh;
}

}  // namespace

ProximityServer::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                            const ServerConfig& config)
    : config_(config),
      nh_(nh),
      private_nh_(private_nh),
      summary_(private_nh, config),
      marker_drawer_(config.query.max_distance, std::max(1.0, 3.0 / config.rate)),
      spheres_(private_nh),
      diagnostics_(nh, without_slash(private_nh.getNamespace()), config),
      buffer_(ros::Duration(10.0), config.pose_timeout),
      zones_(buffer_, config.pose_timeout, config.zones),
      loader_(config, nh),
      live_(private_nh, config),
      contact_loader_(config, loader_,
                      [this] {  // a request waits, or the node ends
                        return !model_thread_.queue()->isEmpty() || !model_thread_.is_running();
                      }),
      ignore_service_(private_nh, loader_),
      zone_services_(private_nh, config_, buffer_, loader_, &zones_) {
  buffer_.subscribe(with_queue(nh, &pose_thread_));
  model_thread_.start("ist model", [this] {
    loader_.load_when_due();
    contact_loader_.pack_when_due();
  });
  proximity_ = private_nh_.advertise<ist_proximity::ProximityArray>("proximity", 10);
  joint_repulsion_ = private_nh_.advertise<ist_proximity::JointRepulsion>("joint_repulsion", 10);
  markers_ = private_nh_.advertise<visualization_msgs::MarkerArray>("markers", 2);
  const auto filtered_cloud = private_nh_.advertise<sensor_msgs::PointCloud2>("filtered_cloud", 2);
  for (const SourceConfig& source : config_.sources) add_source(source, filtered_cloud);
  model_services_ =
      std::make_unique<ModelServices>(private_nh_, model_thread_.queue(), &loader_, memories_);
  if (config_.pose_source == PoseSourceKind::kJointStates) {
    const auto on_state = [this] {
      ++joint_states_received_;
      joint_state_period_.note(Clock::now());
      cycle_signal_.notify();
    };
    joint_states_ = std::make_unique<JointStateListener>(&buffer_, with_queue(nh_, &pose_thread_),
                                                         "joint_states", "", on_state);
  }
  make_services();
  cycle_thread_ = std::thread(&Impl::run_cycles, this);
  pose_thread_.start("ist tf", [this] { buffer_.end_disputes(ros::Time::now()); });
}

ProximityServer::Impl::~Impl() {
  cycle_signal_.stop();
  cycle_thread_.join();
  model_services_.reset();
  loader_.stop();
  model_thread_.stop();
  pose_thread_.stop();
  warm_up_.end();
  query_service_->stop();
  add_ons_.clear();
  query_service_.reset();
  cycle_.reset();
}

/// Makes the add-ons and ~query, which share a thread.
void ProximityServer::Impl::make_services() {
  const AddOnContext context{nh_,
                             private_nh_,
                             config_,
                             loader_,
                             sources_,
                             memories_,
                             buffer_,
                             joint_states_.get(),
                             add_ons_,
                             [this] { return live_config(); },
                             [this](const ros::Time& now) { return ignore_service_.names(now); }};
  make_add_ons(context, &add_ons_);
  query_service_ = std::make_unique<QueryService>(context, [this] {
    publish_diagnostics_when_due();
    for (const std::unique_ptr<AddOn>& add_on : add_ons_) add_on->run_when_due();
  });
  for (const std::unique_ptr<AddOn>& add_on : add_ons_) {
    add_on->subscribe(query_service_->queue());
  }
}

/// Adds a source, and what it remembers.
void ProximityServer::Impl::add_source(const SourceConfig& config, const ros::Publisher& filtered) {
  if (config.type == SourceType::kWorld) {
    inputs_.push_back(std::make_shared<WorldSource>(config, with_queue(nh_, &pose_thread_),
                                                    private_nh_, &buffer_));
    return sources_.push_back(inputs_.back());
  }
  std::shared_ptr<SourceMemory> memory;
  if (config.memory.enabled) {
    memory = std::make_shared<SourceMemory>(config, config_.unknown_space != UnknownSpace::kFree,
                                            buffer_,
                                            advertise_map(&private_nh_, "memory/" + config.name));
    memories_.push_back(memory);
  }
  inputs_.push_back(std::make_shared<SensorSource>(
      config, nh_, buffer_, zones_, filtered, memory,
      [this](const ObstacleSource& source, const SourceSnapshot& fresh) {
        return warm_up_.run(source, fresh);
      }));
  sources_.push_back(inputs_.back());
  if (memory) sources_.push_back(memory);
}

/// Waits until a joint state comes, but not for ever. Joint states that came during the last cycle
/// are taken at once, one after the other.
/// @returns false when it is time to stop
bool ProximityServer::Impl::wait_for_joint_states() {
  const bool goes_on = cycle_signal_.sleep_until(Clock::now() + kMaxWaitForJointStates,
                                                 [this] { return joint_states_->is_waiting(); });
  joint_states_->take_next();
  return goes_on;
}

void ProximityServer::Impl::run_cycles() {
  name_thread("ist cycle");
  if (joint_states_) {
    do {
      run_cycle_guarded();
    } while (wait_for_joint_states());
    return;
  }
  const auto period = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / config_.rate));
  Clock::time_point next = Clock::now();
  do {
    run_cycle_guarded();
    next = std::max(next + period, Clock::now());  // no burst follows a cycle that took too long
  } while (cycle_signal_.sleep_until(next));
}

/// Runs a cycle. Where an exception ends it, a message says so and that nothing is known, and the
/// next cycle is run as usual.
void ProximityServer::Impl::run_cycle_guarded() {
  const std::string fault = exception_of([this] { run_cycle(); });
  if (fault.empty()) return;
  ROS_ERROR_STREAM_THROTTLE(5.0, "a cycle failed, and all links are UNKNOWN: " << fault);
  exception_of([&] { publish_failure(fault); });  // there may be no memory even for that
}

void ProximityServer::Impl::publish_failure(const std::string& fault) {
  const auto message = boost::make_shared<ist_proximity::ProximityArray>();
  const std::lock_guard<std::mutex> lock(report_mutex_);
  ModelState failed = model_ ? *model_ : ModelState();
  failed.problem = "the last cycle failed: " + fault;
  fill_without_model(failed, config_, ros::Time::now(), sources_, message.get(), &report_);
  ++report_.cycles;
  publish(message, false, live_.get().speed_scale);
}

/// Publishes a result and what follows from it. Jacobians and markers cost time, and are made for
/// somebody who listens. The caller holds report_mutex_.
/// @param is_of_cycle  whether the cycle has made it
void ProximityServer::Impl::publish(const ist_proximity::ProximityArrayConstPtr& message,
                                    bool is_of_cycle, const SpeedScaleConfig& speed_scale) {
  const auto self = is_of_cycle ? newest_self_proximity() : nullptr;
  const bool has_cycle = is_of_cycle && cycle_;
  summary_.publish(*message, self.get(), speed_scale, ros::Time::now(),
                   has_cycle ? cycle_->full_speed_reach() : Span<const StoppingReach>());
  publish_message(proximity_, message);
  if (joint_repulsion_.getNumSubscribers() > 0) {
    ist_proximity::JointRepulsion efforts;
    efforts.header.stamp = message->header.stamp;
    efforts.status = message->status;
    efforts.status_text = message->status_text;
    if (has_cycle) {
      cycle_->fill_joint_repulsion(summary_.self_problem(), self.get(), &efforts);
    }
    publish_message(joint_repulsion_, efforts);
  }
  report_.min_distance = summary_.min_distance();
  report_.speed_scale = summary_.summary();
  if (markers_.getNumSubscribers() == 0 || Clock::now() < next_markers_) return;
  next_markers_ = Clock::now() + kMarkerPeriod;
  const MarkerScene scene = has_cycle ? cycle_->marker_scene() : MarkerScene();
  publish_message(markers_, marker_drawer_.draw(*message, scene));
  ++report_.markers_drawn;
}

ist_proximity::ProximityArrayConstPtr ProximityServer::Impl::newest_self_proximity() const {
  for (const std::unique_ptr<AddOn>& add_on : add_ons_) {
    auto newest = add_on->self_proximity(*model_);
    if (newest) return newest;
  }
  return nullptr;
}

void ProximityServer::Impl::run_cycle() {
  const ros::Time now = ros::Time::now();
  notice_clock_jump(now);
  take_model();
  notice_standing_root();
  notice_ignored_links(now);
  const auto message = messages_.take();
  const std::string transform_problem = buffer_.problem();
  LiveConfig live = live_config();
  live.query.deadline = deadline_of(live.query.deadline, period());
  if (live.query.margin != margin_) set_source_targets(live.query);
  if (cycle_) {
    cycle_->set_warm_up(period() <= kLongestWarmPeriod ? &warm_up_ : nullptr);
    cycle_->run(now, sources_, live, transform_problem, message.get());
  }
  {
    const std::lock_guard<std::mutex> lock(report_mutex_);
    if (cycle_) {
      cycle_->report(*message, &report_);
    } else {
      fill_without_model(*model_, config_, std::max(now, last_stamp_), sources_, message.get(),
                         &report_);
    }
    note(Rank::kRemark, "pose", transform_problem, &report_.findings);
    ++report_.cycles;
  }
  last_stamp_ = message->header.stamp;
  message->ignored_links = ignored_;
  Stopwatch watch;
  const std::lock_guard<std::mutex> lock(report_mutex_);
  publish(message, true, live.speed_scale);
  if (cycle_) report_.parts[kPartPublish].add(watch.lap());
}

/// Tells the parts that do not notice a backward jump of the clock themselves.
void ProximityServer::Impl::notice_clock_jump(const ros::Time& now) {
  buffer_.notice_clock_jump();
  if (now < last_now_) {
    last_stamp_ = ros::Time();
    if (cycle_) cycle_->forget();
    summary_.forget();
    spheres_.repeat_after_clock_jump();
  }
  last_now_ = now;
}

void ProximityServer::Impl::publish_diagnostics_when_due() {
  const Clock::time_point now = Clock::now();
  if (now < next_diagnostics_) return;
  next_diagnostics_ = now + std::chrono::seconds(1);
  const std::string fault = exception_of([this] { publish_diagnostics(); });
  if (fault.empty()) return;
  ROS_ERROR_STREAM_THROTTLE(5.0, "the diagnostics are not published: " << fault);
}

void ProximityServer::Impl::publish_diagnostics() {
  CycleReport report;
  std::string counted_problem;
  {
    const std::lock_guard<std::mutex> lock(report_mutex_);
    report = report_;
    counted_problem = counted_problem_;
    report_.worst_deadline = DeadlineCost();
  }
  report.parameter_problem = live_.problem();
  note(Rank::kRemark, "query",
       std::vector<std::string>{report.parameter_problem, live_.without_effect(), counted_problem},
       &report.findings);
  note(Rank::kRemark, "query", zone_services_.remarks(), &report.findings);
  report.zones = zones_.summary(ros::Time::now());
  zone_services_.show();
  spheres_.show(*loader_.state());
  if (joint_states_) {
    report.joint_states = joint_states_->report();
    note(Rank::kRemark, "pose", report.joint_states->problem, &report.findings);
  }
  diagnostics_.publish(report, *loader_.state(), contact_loader_.contacts().get(),
                       joint_states_received_);
}

/// [s] From one cycle to the next.
double ProximityServer::Impl::period() const {
  return joint_states_ ? joint_state_period_.seconds() : 1.0 / config_.rate;
}

LiveConfig ProximityServer::Impl::live_config() const {
  LiveConfig live = live_.get();
  live.contacts = contact_loader_.contacts();
  return live;
}

ProximityServer::ProximityServer(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh, read_parameters(private_nh))) {}

ProximityServer::~ProximityServer() = default;

}  // namespace ist
