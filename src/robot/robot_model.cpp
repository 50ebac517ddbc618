#include "ist_proximity/robot/robot_model.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <map>
#include <sstream>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/solid_queries.h"
#include "internal/packing/packing_cache.h"
#include "internal/robot/link_packing.h"
#include "ist_proximity/geometry/error.h"
#include "packing_jobs.h"

namespace ist {
namespace {

void check_config(const PackingConfig& config) {
  std::ostringstream text;
  if (!std::isfinite(config.max_error) || config.max_error <= 0.0) {
    text << "packing/max_error is " << config.max_error << " m; it must be > 0";
  } else if (config.max_spheres < 1) {
    text << "packing/max_spheres is " << config.max_spheres << "; it must be at least 1";
  }
  if (!text.str().empty()) throw ModelError(text.str());
}

// A link to monitor; without a description it stays UNKNOWN, with `error`.
struct MonitoredLink {
  std::string name;
  const LinkDescription* description = nullptr;
  std::string error;
  std::vector<std::size_t> jobs;  // one per element
};

// The links of a description by name.
struct LinkIndex {
  explicit LinkIndex(const RobotDescription& robot)
      : without_geometry(robot.links_without_geometry.begin(), robot.links_without_geometry.end()) {
    for (const LinkDescription& link : robot.links) with_geometry.insert({link.name, &link});
  }
  std::unordered_map<std::string, const LinkDescription*> with_geometry;
  std::unordered_set<std::string> without_geometry;
};

MonitoredLink monitored(const RobotDescription& robot, const LinkIndex& index,
                        const std::string& name) {
  MonitoredLink link;
  link.name = name;
  const auto found = index.with_geometry.find(name);
  if (found != index.with_geometry.end()) {
    link.description = found->second;
    link.error = link.description->error;
    if (link.error.empty() && link.description->geometry.empty()) {
      link.error = "link '" + name + "' has no geometry";
    }
    for (const GeometryElement& element : link.description->geometry) {
      const std::string fault = link.error.empty() ? element_fault(element) : "";
      if (!fault.empty()) {
        link.error = "link '" + name + "', element '";
        link.error.append(element.source).append("': ").append(fault);
      }
    }
    return link;
  }
  if (index.without_geometry.count(name) > 0) {
    link.error = "link '" + name +
                 "' is to be monitored and has no geometry; give it a <collision> element or take "
                 "it from the list of links";
  } else {
    link.error = "link '" + name + "' is to be monitored and is not in the URDF of robot '" +
                 robot.name + "'; correct the list of links";
  }
  return link;
}

// The monitored links in the URDF's order; names that it lacks come last.
std::vector<MonitoredLink> select_links(const RobotDescription& robot,
                                        const std::vector<std::string>& wanted) {
  const LinkIndex index(robot);
  std::vector<std::string> known = robot.link_order;
  if (known.empty()) {
    for (const LinkDescription& link : robot.links) known.push_back(link.name);
    known.insert(known.end(), robot.links_without_geometry.begin(),
                 robot.links_without_geometry.end());
  }
  const std::unordered_set<std::string> wanted_names(wanted.begin(), wanted.end());
  std::unordered_set<std::string> chosen;
  std::vector<MonitoredLink> links;
  const auto choose = [&](const std::string& name) {
    if (chosen.insert(name).second) links.push_back(monitored(robot, index, name));
  };
  for (const std::string& name : known) {
    const bool is_wanted =
        wanted.empty() ? index.without_geometry.count(name) == 0 : wanted_names.count(name) > 0;
    if (is_wanted) choose(name);
  }
  for (const std::string& name : wanted) choose(name);
  return links;
}

// Makes one job per distinct shape and configuration: two equal fingers are packed once.
std::vector<PackingJob> make_jobs(const PackingConfig& config, std::vector<MonitoredLink>* links) {
  std::vector<PackingJob> jobs;
  std::map<std::string, std::size_t> job_of_key;
  for (std::size_t l = 0; l < links->size(); ++l) {
    MonitoredLink& link = (*links)[l];
    if (!link.error.empty()) continue;
    const LinkGeometry& geometry = link.description->geometry;
    const std::vector<PackingConfig> configs =
        link_configs(geometry, link.description->attached, config);
    for (std::size_t e = 0; e < geometry.size(); ++e) {
      const Shape& shape = geometry[e].shape;
      PackingJob job;
      job.key = packing_key(shape, configs[e]);
      const auto [entry, is_new] = job_of_key.insert({job.key, jobs.size()});
      link.jobs.push_back(entry->second);
      if (!is_new) continue;
      job.shape = &shape;
      job.config = configs[e];
      job.link = l;
      job.work = packing_work(shape);
      jobs.push_back(std::move(job));
    }
  }
  return jobs;
}

LinkModel assemble(const MonitoredLink& link, const std::vector<PackingJob>& jobs,
                   const TreeConfig& tree, const CancelRequest& cancelled) {
  LinkModel model;
  model.name = link.name;
  model.error = link.error;
  if (!model.error.empty()) return model;
  const LinkGeometry& geometry = link.description->geometry;
  std::vector<const Packing*> packings;
  model.from_cache = true;
  for (std::size_t e = 0; e < geometry.size(); ++e) {
    const PackingJob& job = jobs[link.jobs[e]];
    if (!job.error.empty()) {
      model.error = "link '" + link.name + "', element " + std::to_string(e + 1) + " (" +
                    geometry[e].source + ") cannot be packed: " + job.error;
      model.from_cache = false;
      return model;
    }
    packings.push_back(&job.packing);
    model.from_cache = model.from_cache && job.from_cache;
    model.packing_time += job.time;
  }
  model.packing = combine(geometry, packings);
  model.tree = InnerSphereTree(model.packing, tree);
  throw_if(cancelled);
  model.solid = make_solid(geometry, cancelled);
  return model;
}

std::string millimetres(double metres) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2f mm", 1e3 * metres);
  return text;
}

void warn(const std::vector<MonitoredLink>& links, const std::vector<PackingJob>& jobs,
          const RobotModel& model, const PackingConfig& config,
          const std::function<void(const std::string&)>& warning) {
  if (!warning) return;
  for (const PackingJob& job : jobs) {
    if (!job.load_warning.empty()) warning(job.load_warning + "; the link is packed again");
  }
  // A full or read-only disk says the same for every shape.
  const auto refused = std::find_if(
      jobs.begin(), jobs.end(), [](const PackingJob& job) { return !job.store_warning.empty(); });
  if (refused != jobs.end()) warning(refused->store_warning);
  for (std::size_t l = 0; l < links.size(); ++l) {
    const LinkModel& link = model.links[l];
    if (!link.usable()) continue;
    if (links[l].description->used_visual_fallback) {
      warning("link '" + link.name +
              "' has no collision geometry in the URDF; its visual geometry is used instead");
    }
    if (!link.packing.certificate.reached) {
      warning("link '" + link.name + "' is packed with " +
              std::to_string(link.packing.spheres.size()) + " spheres to an error of " +
              millimetres(link.packing.certificate.max_gap) + " instead of " +
              millimetres(config.max_error) + ": packing/max_spheres (" +
              std::to_string(config.max_spheres) + ") was reached first; raise it, or max_error");
    }
  }
}

}  // namespace

std::shared_ptr<const RobotModel> build_robot_model(const RobotDescription& description,
                                                    const RobotModelConfig& config,
                                                    const RobotModelCallbacks& callbacks) {
  check_config(config.packing);
  std::vector<MonitoredLink> links = select_links(description, config.links);
  std::vector<PackingJob> jobs = make_jobs(config.packing, &links);
  const PackingCache cache(config.cache_directory);
  const auto cancelled = [&] { return callbacks.cancelled && callbacks.cancelled(); };
  const auto report = [&](const PackingJob& job, double fraction) {
    if (cancelled()) return false;
    if (callbacks.progress) {
      callbacks.progress({links[job.link].name, job.link, links.size(), fraction});
    }
    return true;
  };
  if (cancelled() || !PackingJobs(&jobs, cache, report).run(config.threads)) return nullptr;

  const auto model = std::make_shared<RobotModel>();
  model->name = description.name;
  model->root_link = description.root_link;
  try {
    for (const MonitoredLink& link : links) {
      throw_if(cancelled);
      model->links.push_back(assemble(link, jobs, config.tree, cancelled));
    }
  } catch (const Cancelled&) {
    return nullptr;
  }
  warn(links, jobs, *model, config.packing, callbacks.warning);
  return model;
}

}  // namespace ist
