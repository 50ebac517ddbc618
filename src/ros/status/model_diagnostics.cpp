#include <algorithm>
#include <cstddef>
#include <string>

#include "internal/robot/anytime_model.h"
#include "internal/robot/model_memory.h"
#include "ros/common/text.h"
#include "ros/status/diagnostics.h"

namespace ist {
namespace {

using diagnostic_msgs::DiagnosticStatus;

std::string contact_geometry_text(const ContactGeometry& body) {
  std::string text;
  if (body.has_volume()) {
    text = std::to_string(body.sphere_count) + format_text(" spheres, %.3f l", 1e3 * body.volume) +
           format_text(", filled to %.0f %%", 100.0 * body.packed_volume / body.volume) +
           (body.from_cache ? ", from the cache" : format_text(", packed in %.1f s", body.time));
  }
  if (!body.note.empty()) text += (text.empty() ? "" : "; ") + body.note;
  return text;
}

/// Adds the contact bodies, and why `penetration` may be NaN in contact.
void add_contacts(const ModelState& state, const ContactModel* contacts, ContactsWanted wanted,
                  const Values& add) {
  if (wanted == ContactsWanted::kNone) {
    add("contact volumes", "off, ~penetration/enabled is false: penetration is NaN in contact");
    return;
  }
  if (!state.robot) return;
  const bool is_current = contacts != nullptr && same_geometry(*contacts->robot, *state.robot);
  std::size_t usable = 0, needed = 0, ready = 0;
  for (const std::size_t i : state.monitored) {
    if (!state.robot->links[i].usable()) continue;
    ++usable;
    const bool is_ready = is_current && contacts->links[i];
    if (is_ready || wanted == ContactsWanted::kAll || state.usage->was_near(i)) ++needed;
    if (!is_ready) continue;
    ++ready;
    add("volume of " + state.robot->links[i].name, contact_geometry_text(*contacts->links[i]));
  }
  add("contact volumes", ready == needed
                             ? "ready"
                             : std::to_string(ready) + " of " + std::to_string(needed) +
                                   " links; penetration is NaN in contact for those to come");
  add("links with a volume", std::to_string(ready) + " of " + std::to_string(usable) +
                                 (ready < usable && wanted == ContactsWanted::kAuto
                                      ? "; the others have none until something comes near them"
                                      : ""));
}

bool falls_short(const LinkModel& link) {
  return link.usable() && link.is_final && !link.packing.certificate.reached;
}

/// The packing of a link that is usable.
std::string packing_text(const LinkModel& link) {
  const PackingCertificate& certificate = link.packing.certificate;
  std::string text = std::string(link.is_final ? "final" : "coarse") + ", " +
                     std::to_string(link.packing.spheres.size()) + " spheres, largest gap " +
                     millimetres(certificate.max_gap) + ", mean " +
                     millimetres(certificate.mean_gap);
  if (certificate.unreachable_area > 0) {
    text += format_text(", %.1f cm2 of sheets", 1e4 * certificate.unreachable_area);
  }
  if (falls_short(link)) text += ", ~packing/max_error not reached";
  return text + (link.from_cache ? ", from the cache"
                                 : format_text(", packed in %.1f s", link.packing_time));
}

double megabytes(std::size_t bytes) { return 1e-6 * static_cast<double>(bytes); }

void add_packings(const ModelState& state, const Values& add) {
  if (!state.robot) return;
  std::size_t usable = 0, final = 0, spheres = 0, fields = 0, coarse_fields = 0;
  double largest_gap = 0.0;
  for (const std::size_t i : state.monitored) {
    const LinkModel& link = state.robot->links[i];
    if (!link.usable()) continue;
    ++usable;
    final += link.is_final ? 1 : 0;
    fields += link.field != nullptr ? 1 : 0;
    coarse_fields += AnytimeModel::next_step(link) == AnytimeModel::LinkStep::kFineField ? 1 : 0;
    spheres += link.packing.spheres.size();
    largest_gap = std::max(largest_gap, link.packing.certificate.max_gap);
  }
  add("links with their final packing",
      std::to_string(final) + " of " + std::to_string(usable) +
          (final < usable ? "; the others get it when contact or link pairs need it" : ""));
  add("links with a distance field",
      std::to_string(fields) + " of " + std::to_string(usable) +
          (coarse_fields > 0 ? ", " + std::to_string(coarse_fields) + " coarse" : "") +
          (fields < usable ? "; the others will get one" : ""));
  add("spheres", spheres);
  const ModelMemory memory = memory_of(*state.robot);
  add("memory", format_text("%.1f MB: ", megabytes(memory.total())) +
                    format_text("packings %.1f, ", megabytes(memory.packings)) +
                    format_text("trees %.1f, ", megabytes(memory.trees)) +
                    format_text("exact geometry %.1f, ", megabytes(memory.solids)) +
                    format_text("distance fields %.1f", megabytes(memory.fields)));
  add("largest gap", millimetres(largest_gap));
}

}  // namespace

void note_model(const ModelState& state, Findings* findings) {
  for (const std::size_t i : state.monitored) {
    const LinkModel& link = state.robot->links[i];
    if (!falls_short(link)) continue;
    note(Rank::kRemark, "model", "link '" + link.name + "': " + packing_text(link), findings);
  }
  note(Rank::kRemark, "model", state.warnings, findings);
}

DiagnosticStatus model_diagnostics(const std::string& node, const Findings& findings,
                                   const ModelState& state, const ContactModel* contacts,
                                   ContactsWanted contacts_wanted) {
  DiagnosticStatus status = make_diagnostic(node, "model", findings);
  const Values add{&status};
  const bool ready = state.is_ready();
  add("ready", ready ? "100 %" : format_text("%.0f %%", 100 * state.fraction));
  add("links monitored", state.links.size());
  if (ready) add("links", link_counts(state));
  if (!state.choice.remarks.empty()) add("links left out", state.choice.remarks);
  for (const AttachedObject& object : state.objects) {
    add("attached object", "'" + object.name + "' on '" + object.link + "'");
  }
  for (const std::size_t i : state.monitored) {
    const LinkModel& link = state.robot->links[i];
    if (is_pending(link)) continue;
    add(link.name, link.usable() ? packing_text(link) : link.error);
  }
  add_packings(state, add);
  add_contacts(state, contacts, contacts_wanted, add);
  for (const std::string& warning : state.warnings) add("warning", warning);
  return status;
}

}  // namespace ist
