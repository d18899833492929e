// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/StateHash.h"

#include <algorithm>
#include <array>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/StateHash.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Mixes `words` values into each chain; value i goes to chain i mod kChains.
void mix(const float* values, std::size_t words, std::uint32_t* chains) {
  using D = hn::CappedTag<std::uint32_t, 16>;
  constexpr D d;
  constexpr std::size_t kLanes = hn::MaxLanes(d), kVectors = StateHash::kChains / kLanes;
  const hn::Rebind<float, D> float_tag;
  const auto multiplier = hn::Set(d, 0x9e3779b1U);
  hn::Vec<D> chain[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) chain[v] = hn::LoadU(d, chains + v * kLanes);
  for (std::size_t w = 0; w < words; ++w)
    for (std::size_t v = 0; v < kVectors; ++v) {
      const auto word = hn::BitCast(d, hn::LoadU(float_tag, values + w * StateHash::kChains + v * kLanes));
      chain[v] = hn::RotateRight<19>(hn::Mul(hn::Xor(chain[v], word), multiplier));
    }
  for (std::size_t v = 0; v < kVectors; ++v) hn::StoreU(chain[v], d, chains + v * kLanes);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {
namespace {

// Cells per block: few enough that the block stays in a core's cache between copying and hashing. Part of the
// hash's definition.
constexpr std::size_t kBlockCells = 4096;
constexpr double kCostPerCell_ns = 0.5;

}  // namespace

HWY_EXPORT(mix);

// FNV-1a over 32-bit words, with a rotation that carries high bits into low ones.
void StateHash::add(std::uint32_t word) noexcept {
  value_ = common::fnv_mix(value_, word);
  value_ = std::rotl(value_, 23);
}

void StateHash::add(std::span<const float> values) noexcept {
  std::uint32_t chains[kChains] = {};
  const std::size_t words = values.size() / kChains;
  if (words > 0) {
    HWY_DYNAMIC_DISPATCH(mix)(values.data(), words, chains);
    for (const std::uint32_t chain : chains) add(chain);
  }
  for (const float value : values.subspan(words * kChains)) add(std::bit_cast<std::uint32_t>(value));
}

StateHash hash_objects(const scene::Snapshot& snapshot) {
  auto flatten = []<std::size_t N>(const std::vector<std::array<float, N>>& all) {
    return all.empty() ? std::span<const float>() : std::span(all.front().data(), N * all.size());
  };
  StateHash hash;
  for (const scene::ObjectId id : snapshot.id) hash.add(id);
  hash.add(flatten(snapshot.position));
  hash.add(flatten(snapshot.orientation));
  hash.add(flatten(snapshot.velocity));
  hash.add(flatten(snapshot.angular_velocity));
  return hash;
}

void FieldHasher::copy_and_hash(const surface::Field& field, bool changed, std::vector<float>& height,
                                StateHash& hash) {
  const std::size_t cells = field.height.size(), blocks = (cells + kBlockCells - 1) / kBlockCells;
  height.resize(cells);
  const bool rehash = changed || block_hashes_.size() != blocks;
  block_hashes_.resize(blocks);
  const auto work = [&](int begin, int end) {
    for (int b = begin; b < end; ++b) {
      const std::size_t first = b * kBlockCells, count = std::min(kBlockCells, cells - first);
      const auto heights = std::span(height).subspan(first, count);
      std::copy_n(&field.height[first], count, heights.begin());
      if (!rehash) continue;
      StateHash block_hash;
      block_hash.add(heights);
      block_hash.add(std::span(field.speed).subspan(first, count));
      if (field.has_tilt())
        for (std::size_t i = first; i < first + count; ++i)
          block_hash.add(std::array{field.tilt[i].roll, field.tilt[i].pitch});
      if (field.has_offset())
        for (std::size_t i = first; i < first + count; ++i)
          block_hash.add(std::array{field.offset[i].x(), field.offset[i].y()});
      block_hashes_[b] = block_hash.value();
    }
  };
  if (pool_ != nullptr)
    pool_->parallel_for_rows(static_cast<int>(blocks), kCostPerCell_ns * static_cast<double>(cells), work);
  else
    work(0, static_cast<int>(blocks));
  for (const std::uint64_t block_hash : block_hashes_) {
    hash.add(static_cast<std::uint32_t>(block_hash));
    hash.add(static_cast<std::uint32_t>(block_hash >> 32U));
  }
  if (!field.has_skin()) return;
  hash.add(field.skin.height);
  hash.add(field.skin.speed);
}

}  // namespace smartsurf::world
#endif
