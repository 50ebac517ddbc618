#include "repulsion/measure.h"

#include <algorithm>
#include <cmath>

#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "support.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kDensityStride = 25;  // steps

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / EIGEN_PI;
}

// Queries one cloud, link by link, each with its own warm start, as in a 1 kHz cycle.
class Asker {
 public:
  Asker(const std::shared_ptr<const RobotModel>& model, const CloudSnapshot& cloud)
      : repulsion_(model), clouds_{&cloud}, known_(model->links.size(), false) {
    for (std::size_t i = 0; i < known_.size(); ++i) queries_.emplace_back(model, QueryConfig());
  }

  Eigen::Vector3d ask(std::size_t link, const std::vector<Eigen::Isometry3d>& X_FL) {
    known_[link] = true;
    timer_.lap();
    queries_[link].run(X_FL, known_, clouds_, &answers_);
    query_us = timer_.lap();
    const Eigen::Vector3d blend = repulsion_(link, X_FL[link], clouds_, answers_[link], {});
    blend_us = timer_.lap();
    known_[link] = false;
    return blend;
  }
  /// The blend of the last ask() with another smoothing.
  Eigen::Vector3d narrow(std::size_t link, const std::vector<Eigen::Isometry3d>& X_FL) const {
    RepulsionConfig config;
    config.smoothing = kNarrow;
    return repulsion_(link, X_FL[link], clouds_, answers_[link], config);
  }
  const LinkProximity& answer(std::size_t link) const { return answers_[link]; }

  double query_us = 0.0, blend_us = 0.0;  // of the last ask()

 private:
  std::vector<ProximityQuery> queries_;
  Repulsion repulsion_;
  std::vector<const CloudSnapshot*> clouds_;
  std::vector<bool> known_;
  std::vector<LinkProximity> answers_;
  ThreadTimer timer_;
};

// The repulsion along the nearest pair alone, with the same strength as the blend.
Eigen::Vector3d nearest_pair(const LinkProximity& answer) {
  const double strength = repulsion_strength(answer, {});
  return strength > 0.0 ? Eigen::Vector3d(strength * answer.direction) : Eigen::Vector3d::Zero();
}

bool moves(const MovingScene& scene, std::size_t link) {
  return !scene.steps.front()[link].isApprox(scene.steps.back()[link], 1e-9);
}

// The force of one link's wrench along the motion [m^3], for a stiffness of 1.
class Contact {
 public:
  Contact(const LinkModel& link, const ContactGeometry& body, const MovingScene& scene)
      : link_(link), body_(body), clouds_{&scene.cloud} {}

  void ask(const Eigen::Isometry3d& X_FL, LinkState state, bool begins, bool in_reference) {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    if (state == LinkState::kContact) {
      force = X_FL.linear() * contact_volume(link_, body_, X_FL, clouds_).weighted_normal;
    }
    largest_ = std::max(largest_, force.norm());
    steps_.push_back({force, begins, in_reference});
  }

  /// Adds the steps relative to the largest force.
  /// @param counts  by step of the reference: whether the step to it counts; overwritten
  void add_to(Noise* noise, std::vector<bool>* counts) const {
    counts->clear();
    for (std::size_t k = 0; k < steps_.size(); ++k) {
      const bool follows = k > 0 && !steps_[k].begins && largest_ > 0.0;
      const Eigen::Vector3d before = follows ? steps_[k - 1].force / largest_ : steps_[k].force,
                            now = follows ? steps_[k].force / largest_ : steps_[k].force;
      const bool in_reference = follows && steps_[k].in_reference && steps_[k - 1].in_reference &&
                                std::min(before.norm(), now.norm()) >= kShort;
      if (follows) noise->add(before, now, false, in_reference);
      if (steps_[k].in_reference) counts->push_back(in_reference);
    }
  }

 private:
  struct Step {
    Eigen::Vector3d force;
    bool begins, in_reference;
  };

  const LinkModel& link_;
  const ContactGeometry& body_;
  std::vector<const CloudSnapshot*> clouds_;
  std::vector<Step> steps_;
  double largest_ = 0.0;
};

// Adds the steps of the wrench of every link, and overwrites `counts` (by step and link) for it.
void add_wrenches(const std::vector<Contact>& contacts, Noise* noise,
                  std::vector<std::vector<bool>>* counts) {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    std::vector<bool> of_link;
    contacts[i].add_to(noise, &of_link);
    for (std::size_t k = 0; k < counts->size(); ++k) {
      (*counts)[k][i] = k < of_link.size() && of_link[k];
    }
  }
}

}  // namespace

void Noise::add(const Eigen::Vector3d& before, const Eigen::Vector3d& now, bool is_free,
                bool in_reference) {
  if (before.isZero(0.0) && now.isZero(0.0)) return;
  lengths.push_back(std::abs(now.norm() - before.norm()));
  if (is_free) free_lengths.push_back(lengths.back());
  if (std::min(before.norm(), now.norm()) < kShort) {
    ++short_steps;
    return;
  }
  angles.push_back(degrees_between(before, now));
  if (is_free) free_angles.push_back(angles.back());
  if (in_reference) variation += angles.back();
}

Measured measure(const MovingScene& scene, const std::shared_ptr<const RobotModel>& model,
                 const std::vector<std::shared_ptr<const ContactGeometry>>& bodies) {
  Measured measured;
  const std::size_t links = model->links.size();
  Asker full(model, scene.cloud), half(model, scene.half), twice(model, scene.twice);
  std::vector<Eigen::Vector3d> blends(links), nearests(links), narrows(links);
  std::vector<std::vector<bool>> counts;
  std::vector<Contact> contacts;
  for (std::size_t i = 0; i < links; ++i) contacts.emplace_back(model->links[i], *bodies[i], scene);
  for (std::size_t step = 0; step < scene.steps.size(); ++step) {
    const std::vector<Eigen::Isometry3d>& X_FL = scene.steps[step];
    const bool in_reference =
        step >= scene.reference_begin && step < scene.reference_begin + scene.reference_count;
    if (in_reference) counts.emplace_back(links, false);
    for (std::size_t i = 0; i < links; ++i) {
      if (!moves(scene, i)) continue;
      const Eigen::Vector3d blend = full.ask(i, X_FL);
      const LinkProximity& answer = full.answer(i);
      const Eigen::Vector3d nearest = nearest_pair(answer), narrow = full.narrow(i, X_FL);
      contacts[i].ask(X_FL[i], answer.state, scene.begins[step], in_reference);
      const bool is_free = answer.state != LinkState::kContact;
      const bool compared = in_reference && answer.state == LinkState::kNear &&
                            blend.norm() > kShort && step > scene.reference_begin &&
                            !scene.begins[step];
      if (in_reference) counts.back()[i] = compared;
      if (nearest.norm() > 0.0) {
        measured.query_us.push_back(full.query_us);
        measured.blend_us.push_back(full.blend_us);
        if (step % kDensityStride == 0) {
          measured.half.push_back((half.ask(i, X_FL) - blend).norm());
          measured.narrow_half.push_back((half.narrow(i, X_FL) - narrow).norm());
          measured.twice.push_back((twice.ask(i, X_FL) - blend).norm());
          measured.narrow_twice.push_back((twice.narrow(i, X_FL) - narrow).norm());
        }
      }
      if (!scene.begins[step]) {
        measured.blend.add(blends[i], blend, is_free, compared);
        measured.narrow.add(narrows[i], narrow, is_free, compared);
        measured.nearest.add(nearests[i], nearest, is_free, compared);
      }
      blends[i] = blend;
      narrows[i] = narrow;
      nearests[i] = nearest;
    }
  }
  measured.reference_variation = reference_variation(scene, counts);
  add_wrenches(contacts, &measured.wrench, &counts);
  measured.wrench_reference_variation = wrench_reference_variation(scene, *model, counts);
  return measured;
}

}  // namespace ist::benchmark
