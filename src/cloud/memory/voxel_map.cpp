#include "cloud/memory/voxel_map.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "cloud/memory/block_bits.h"

namespace ist {
namespace {

constexpr double kTick = 0.01;  // [s] of VoxelBlock's times: 32 bits last for 490 days
constexpr double kMaxTicks = 4e9;
// One in so many blocks is forgotten when memory is short, at least.
constexpr std::size_t kForgottenShare = 8;
// [voxels] The end of a ray answers for places that lie so far behind it.
constexpr double kShade[] = {0.5, 1.0};

float log_odds_of(double probability) {
  return static_cast<float>(std::log(probability / (1.0 - probability)));
}

void require(bool valid, const char* member, double value, const char* range) {
  if (valid) return;
  std::ostringstream text;
  text << "MemoryConfig::" << member << " is " << value << ", it must be " << range << ".";
  throw std::invalid_argument(text.str());
}

const MemoryConfig& checked(const MemoryConfig& config) {
  require(config.decay > 0.0, "decay", config.decay, "more than 0 s");
  require(config.resolution >= 0.001 && config.resolution <= 1.0, "resolution", config.resolution,
          "from 0.001 to 1 m");
  require(config.max_nodes >= 4096, "max_nodes", static_cast<double>(config.max_nodes),
          "4096 or more");
  require(config.max_range > 0.0 && std::isfinite(config.max_range), "max_range", config.max_range,
          "more than 0 m, and finite");
  require(config.hit >= 0.5 && config.hit < 1.0, "hit", config.hit, "from 0.5 to 1");
  require(config.miss > 0.0 && config.miss <= 0.5, "miss", config.miss, "from 0 to 0.5");
  require(config.clamp_min > 0.0 && config.clamp_min <= 0.5, "clamp_min", config.clamp_min,
          "from 0 to 0.5");
  require(config.clamp_max >= 0.5 && config.clamp_max < 1.0, "clamp_max", config.clamp_max,
          "from 0.5 to 1");
  return config;
}

/// Forgets the voxels of a block that were measured before `limit`.
/// @returns whether none is left
bool forget_before(std::uint32_t limit, VoxelBlock* block) {
  if (block->oldest < limit) {
    std::uint32_t oldest = std::numeric_limits<std::uint32_t>::max();
    for_each_bit(BlockBits(block->known), [&](unsigned place) {
      if (block->time[place] >= limit) {
        oldest = std::min(oldest, block->time[place]);
        return;
      }
      block->log_odds[place] = std::numeric_limits<float>::quiet_NaN();
      clear_bit(place, &block->known);
      clear_bit(place, &block->occupied);
    });
    block->oldest = oldest;
  }
  return block->known == BlockBits{};
}

}  // namespace

VoxelMap::VoxelMap(const MemoryConfig& config)
    : config_(checked(config)),
      scale_(config.resolution),
      blocks_(config.max_nodes / kBlockVoxels),
      hit_(log_odds_of(config.hit)),
      miss_(log_odds_of(config.miss)),
      least_(log_odds_of(config.clamp_min)),
      most_(log_odds_of(config.clamp_max)) {}

void VoxelMap::set_region(const RegionOfInterest& region_M) {
  const auto limit = [&](double coordinate, std::int32_t outside) {
    std::int32_t key = outside;
    scale_.key(coordinate, &key);
    return key;
  };
  const Eigen::Vector3d& c = region_M.center_F;
  const double r = region_M.radius;
  low_ = {limit(c.x() - r, 0), limit(c.y() - r, 0), limit(c.z() - r, 0)};
  high_ = {limit(c.x() + r, kKeyEnd - 1), limit(c.y() + r, kKeyEnd - 1),
           limit(c.z() + r, kKeyEnd - 1)};
}

void VoxelMap::insert(const MemoryScan& scan) {
  if (!scan.origin.allFinite()) {
    throw std::invalid_argument("the sensor's position in the memory's frame is not finite.");
  }
  set_now(scan.stamp);
  forget_old();
  ++frame_;
  touched_.clear();
  reset_cursor();
  if (skipped_ > 0 || blocks_.size() + added_ > blocks_.max_size()) make_place(added_, false);
  const std::size_t size_before = blocks_.size();
  find_ends(scan.origin, scan.hits);
  mark_hits();
  add_rays(scan.origin);
  find_ends(scan.origin, scan.free_ends);
  for (RayEnd& end : ray_ends_) end.is_hit = false;
  add_rays(scan.origin);
  apply(tick(std::isfinite(scan.stamp) ? scan.stamp : now_));
  added_ = blocks_.size() - std::min(size_before, blocks_.size());
}

void VoxelMap::clear() {
  blocks_.clear();
  reset_cursor();
  now_ = std::numeric_limits<double>::quiet_NaN();
}

void VoxelMap::clear_free() {
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    VoxelBlock& block = blocks_[i];
    for_each_bit(without(block.known, block.occupied), [&](unsigned place) {
      block.log_odds[place] = std::numeric_limits<float>::quiet_NaN();
    });
    block.known = block.occupied;
  }
  remove_empty_blocks();
}

void VoxelMap::shift_times(double seconds) {
  epoch_ += seconds;
  first_ += seconds;
  now_ += seconds;
}

void VoxelMap::remove_empty_blocks() {
  blocks_.remove_if([](const VoxelBlock& block) { return block.known == BlockBits{}; });
  reset_cursor();
}

std::uint32_t VoxelMap::tick(double time) const {
  const double ticks = (time - epoch_) / kTick;
  return ticks >= 0.0 ? static_cast<std::uint32_t>(std::min(ticks, kMaxTicks)) : 0;  // NaN: 0
}

double VoxelMap::time(std::uint32_t tick) const {
  return tick == 0 ? first_ : epoch_ + kTick * tick;
}

void VoxelMap::set_now(double time) {
  if (!std::isfinite(time)) return;
  if (std::isnan(now_)) {
    blocks_.clear();
    reset_cursor();
    now_ = epoch_ = first_ = time;
  }
  now_ = std::max(now_, time);
  if ((now_ - epoch_) / kTick >= kMaxTicks) {
    forget_old();
    move_epoch(now_ - std::clamp(config_.decay, 0.5 * kTick * kMaxTicks, 0.8 * kTick * kMaxTicks));
  }
}

/// Counts ticks from a later time on. What was measured before it stays, as old as the first of
/// all, and is forgotten late: that is the case with a decay of more than a year alone.
void VoxelMap::move_epoch(double epoch) {
  const auto earlier =
      static_cast<std::uint64_t>(std::min((epoch - epoch_) / kTick, 2.0 * kMaxTicks));
  const auto moved = [earlier](std::uint32_t time) {
    return time > earlier ? static_cast<std::uint32_t>(time - earlier) : 0U;
  };
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    VoxelBlock& block = blocks_[i];
    for_each_bit(BlockBits(block.known),
                 [&](unsigned place) { block.time[place] = moved(block.time[place]); });
    block.oldest = moved(block.oldest);
    block.newest = moved(block.newest);
  }
  epoch_ = epoch;
}

bool VoxelMap::is_inside(const VoxelKey& key) const {
  return key.x >= low_.x && key.y >= low_.y && key.z >= low_.z && key.x <= high_.x &&
         key.y <= high_.y && key.z <= high_.z;
}

/// The block of a voxel, with its bits emptied for this cloud; null: there is no memory for it.
VoxelBlock* VoxelMap::block_for(const VoxelKey& key) {
  const std::uint64_t id = block_id(key);
  if (id == last_id_) return last_block_;
  VoxelBlock* block = blocks_.find_or_add(id);
  if (block != nullptr && block->frame != frame_) {
    block->frame = frame_;
    block->hit = block->free = block->shaded = BlockBits{};
    touched_.push_back(block);
  }
  last_id_ = id;
  last_block_ = block;
  return block;
}

void VoxelMap::mark(const VoxelKey& key, BlockBits VoxelBlock::*bits) {
  VoxelBlock* block = block_for(key);
  if (block == nullptr) {
    ++skipped_;
    return;
  }
  set_bit(place_in_block(key), &(block->*bits));
}

/// Marks what a ray passes, within the region. A ray that has come into it ends where it leaves it.
void VoxelMap::mark_ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& end) {
  VoxelKey first, last;
  if (!scale_.key(origin, &first) || !scale_.key(end, &last)) return;
  // The cursor is here and not a member, so that the compiler keeps it in registers.
  std::uint64_t id = kNoBlock;
  VoxelBlock* block = nullptr;
  std::size_t skipped = 0;
  const auto mark_free = [&](const VoxelKey& key) {
    const std::uint64_t here = block_id(key);
    if (here != id) {
      id = here;
      block = block_for(key);
    }
    if (block != nullptr) {
      set_bit(place_in_block(key), &block->free);
    } else {
      ++skipped;
    }
  };
  if (is_inside(first) && is_inside(last)) {  // and so is all in between
    walk_ray(scale_, origin, end, first, last, [&](const VoxelKey& key) {
      mark_free(key);
      return true;
    });
  } else {
    bool was_inside = false;
    walk_ray(scale_, origin, end, first, last, [&](const VoxelKey& key) {
      if (!is_inside(key)) return !was_inside;
      was_inside = true;
      mark_free(key);
      return true;
    });
  }
  skipped_ += skipped;
}

/// Marks what lies just behind the end of a ray, in blocks that are there.
void VoxelMap::mark_shade(const Eigen::Vector3f& origin, const Eigen::Vector3f& end) {
  const Eigen::Vector3d p = end.cast<double>();
  const Eigen::Vector3d direction = (end - origin).cast<double>().normalized();
  for (const double behind : kShade) {
    VoxelKey key;
    if (!scale_.key(Eigen::Vector3d(p + behind * config_.resolution * direction), &key)) continue;
    if (blocks_.find(block_id(key)) == nullptr) continue;
    set_bit(place_in_block(key), &block_for(key)->shaded);
  }
}

/// Finds where the rays of a cloud end: cut off at the largest range, and with `discretize` one for
/// each voxel.
void VoxelMap::find_ends(const Eigen::Vector3f& origin, const std::vector<Eigen::Vector3f>& ends) {
  ends_seen_.clear();
  ray_ends_.clear();
  for (Eigen::Vector3f end : ends) {
    VoxelKey key;
    if (!scale_.key(end, &key)) continue;
    if (config_.discretize) {
      if (!ends_seen_.insert(key)) continue;
      end = scale_.middle(key).cast<float>();
    }
    const Eigen::Vector3f ray = end - origin;
    const double length = octomap_norm(ray);
    const bool is_cut = length > config_.max_range;
    if (is_cut) {
      const Eigen::Vector3f direction = ray / static_cast<float>(length);
      end = origin + direction * static_cast<float>(config_.max_range);
    }
    ray_ends_.push_back({end, !is_cut && scale_.key(end, &key) && is_inside(key)});
  }
}

/// Marks the ends of rays as hit, before any ray takes memory. Where there is none for an obstacle,
/// what is older makes place at once.
void VoxelMap::mark_hits() {
  std::vector<std::uint64_t> missing;  // blocks; empty unless memory is short
  const auto mark_all = [&] {
    skipped_ = 0;
    for (const RayEnd& end : ray_ends_) {
      VoxelKey key;
      if (!end.is_hit || !scale_.key(end.p, &key)) continue;
      const std::size_t skipped_before = skipped_;
      mark(key, &VoxelBlock::hit);
      if (skipped_ > skipped_before) missing.push_back(block_id(key));
    }
  };
  mark_all();
  if (missing.empty()) return;
  std::sort(missing.begin(), missing.end());
  const auto end = std::unique(missing.begin(), missing.end());
  make_place(static_cast<std::size_t>(end - missing.begin()), true);
  mark_all();
  lost_ += skipped_;
}

void VoxelMap::add_rays(const Eigen::Vector3f& origin) {
  for (const RayEnd& end : ray_ends_) {
    mark_ray(origin, end.p);
    if (end.is_hit) mark_shade(origin, end.p);
  }
}

void VoxelMap::update(VoxelBlock* block, unsigned place, float change, std::uint32_t time) {
  float& value = block->log_odds[place];
  value = std::clamp((std::isnan(value) ? 0.0F : value) + change, least_, most_);
  note(block, place, time, change > 0.0F);
}

/// Notes what a voxel's log-odds are now. A voxel that stays occupied keeps the time of its last
/// hit, and what comes late makes none older.
void VoxelMap::note(VoxelBlock* block, unsigned place, std::uint32_t time, bool is_hit) {
  if (test_bit(block->known, place)) time = std::max(time, block->time[place]);
  set_bit(place, &block->known);
  if (block->log_odds[place] >= 0.0F) {
    set_bit(place, &block->occupied);
    if (!is_hit) return;
  } else {
    clear_bit(place, &block->occupied);
  }
  block->time[place] = time;
  block->oldest = std::min(block->oldest, time);
  block->newest = std::max(block->newest, time);
}

void VoxelMap::apply(std::uint32_t time) {
  for (VoxelBlock* block : touched_) {
    for_each_bit(without(block->free, block->hit),
                 [&](unsigned place) { update(block, place, miss_, time); });
    for_each_bit(block->hit, [&](unsigned place) { update(block, place, hit_, time); });
  }
}

void VoxelMap::assign(const VoxelKey& key, float log_odds, double time) {
  VoxelBlock* block = blocks_.find_or_add(block_id(key));
  if (block == nullptr) return;
  block->log_odds[place_in_block(key)] = log_odds;
  note(block, place_in_block(key), tick(time), true);
}

void VoxelMap::forget_old() {
  if (std::isnan(now_) || !(now_ - config_.decay > epoch_)) return;
  const std::uint32_t limit = tick(now_ - config_.decay);
  bool any_empty = false;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    any_empty = forget_before(limit, &blocks_[i]) || any_empty;
  }
  if (any_empty) remove_empty_blocks();
}

/// Forgets blocks: those that were measured longest ago, those without anything occupied first,
/// those of the cloud that is being inserted never.
/// @param wanted     blocks; an eighth of all at least, and half of them at most
/// @param obstacles  whether blocks with something occupied may be forgotten
void VoxelMap::make_place(std::size_t wanted, bool obstacles) {
  using Age = std::pair<bool, std::uint32_t>;
  const auto age = [](const VoxelBlock& block) {
    return Age(block.occupied != BlockBits{}, block.newest);
  };
  const auto may_go = [&](const VoxelBlock& block) {
    return !is_touched(block) && (obstacles || !age(block).first);
  };
  std::vector<Age> ages;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (may_go(blocks_[i])) ages.push_back(age(blocks_[i]));
  }
  if (ages.empty()) return;
  const std::size_t share = ages.size() / kForgottenShare;
  std::size_t allowed = std::min(ages.size() / 2, std::max(share, wanted)) + 1;
  const auto last = ages.begin() + static_cast<std::ptrdiff_t>(allowed - 1);
  std::nth_element(ages.begin(), last, ages.end());
  const Age limit = *last;
  blocks_.remove_if([&](const VoxelBlock& block) {
    if (allowed == 0 || !may_go(block) || age(block) > limit) return false;
    --allowed;
    forgotten_ += count_bits(block.known);
    lost_ += count_bits(block.occupied);
    return true;
  });
  reset_cursor();
}

void VoxelMap::reset_cursor() {
  last_id_ = kNoBlock;
  last_block_ = nullptr;
}

BlockBits VoxelMap::hidden(const VoxelBlock& block) const {
  if (block.frame != frame_) return block.occupied;
  return without(without(without(block.occupied, block.hit), block.free), block.shaded);
}

}  // namespace ist
