#include "smartsurf/surface/raycast/RayCaster.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/raycast/SlabClip.h"

namespace smartsurf::surface {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

// Approximate costs: updating the height bounds by one cell, casting the rays of about twenty cells to a
// body, testing a pin on a ray, skipping a cell without bodies.
constexpr double kHeightCost_ns = 0.2, kBodyCost_ns = 80.0, kPinCost_ns = 0.3, kEmptyCellCost_ns = 0.01;

// Returns the first and last offset, relative to the ray's own cell, of the cells whose centre lies in
// [low, high] along one axis.
std::pair<int, int> cell_offsets_within(float low, float high, float pitch, int max_offset) {
  const auto limit = static_cast<float>(max_offset);
  return {static_cast<int>(std::ceil(std::clamp(low / pitch, -limit, limit))),
          static_cast<int>(std::floor(std::clamp(high / pitch, -limit, limit)))};
}

}  // namespace

RayCaster::RayCaster(const Field& field, const CellRay& ray)
    : rows_(field.rows),
      columns_(field.columns),
      blocks_((field.columns + kBlock - 1) / kBlock),
      pitch_(field.pitch),
      ray_(ray),
      distance_(field.cells(), ray.range),
      tag_(kTagPadding + distance_.size(), 0.0F),
      dirty_blocks_(rows_ * blocks_, field.is_rectangular() ? 0 : 1),
      row_min_height_(rows_),
      row_max_height_(row_min_height_.size()) {
  if (!field.is_rectangular()) {
    build_strips(field);
    if (ray.hits_pins) build_pin_intervals(field);
    return;
  }
  for (int c = 0; c < columns_; ++c) x_.push_back(static_cast<float>(c) * pitch_ + ray.origin.x());
  if (ray.hits_pins) build_pin_steps(field);
}

bool RayCaster::is_vertical() const noexcept {
  return ray_.direction.x() == 0.0F && ray_.direction.y() == 0.0F;
}

double RayCaster::cost_ns(std::size_t bodies) const noexcept {
  const double pins = strips_
                          ? static_cast<double>(pin_intervals_.size())
                          : static_cast<double>(pin_steps_.size()) * static_cast<double>(distance_.size());
  return kBodyCost_ns * static_cast<double>(bodies) + kPinCost_ns * pins;
}

// True if the ray never descends below the top of its own cell.
bool RayCaster::clears_own_pin() const noexcept {
  return ray_.from_top && ray_.direction.z() >= 0.0F && ray_.origin.z() >= 0.0F;
}

// For each row of pins, clips the ray to the row, and then to each column it passes there.
void RayCaster::build_pin_steps(const Field& field) {
  const Eigen::Vector3f& o = ray_.origin;
  const Eigen::Vector3f& d = ray_.direction;
  const float reach = ray_.range * std::abs(d.y()) + field.half_top_y;
  const auto [south, north] = cell_offsets_within(o.y() - reach, o.y() + reach, pitch_, rows_ - 1);
  for (int j = south; j <= north; ++j) {
    TInterval row{0.0F, ray_.range};
    if (!clip_slab(o.y() - static_cast<float>(j) * pitch_, d.y(), field.half_top_y, row)) continue;
    const float a = o.x() + d.x() * row.t_enter, b = o.x() + d.x() * row.t_exit;
    const auto [west, east] = cell_offsets_within(std::min(a, b) - field.half_top_x,
                                                  std::max(a, b) + field.half_top_x, pitch_, columns_ - 1);
    for (int i = west; i <= east; ++i) {
      if (i == 0 && j == 0 && clears_own_pin()) continue;
      TInterval pin = row;
      if (clip_slab(o.x() - static_cast<float>(i) * pitch_, d.x(), field.half_top_x, pin))
        pin_steps_.push_back({-j, i, pin.t_enter, pin.t_exit});
    }
  }
  std::ranges::stable_sort(pin_steps_, {}, &PinStep::t_enter);
}

void RayCaster::cast(const RayBodies& bodies, std::span<const float> tags, float pin_tag,
                     std::span<const float> height, common::ThreadPool& pool) {
  assert(height.size() == distance_.size() && tags.size() == bodies.size());
  CastParams params{.job = {.bodies = bodies,
                            .tags = tags,
                            .clusters = bodies.clusters(),
                            .origin = ray_.origin,
                            .direction = ray_.direction,
                            .range = ray_.range,
                            .rows = rows_,
                            .columns = columns_,
                            .blocks_per_row = blocks_,
                            .pitch = pitch_},
                    .height = height.data(),
                    .pin_tag = pin_tag};
  // With many stacked objects, height bounds let the cast skip those that no ray reaches.
  const bool is_dense = bodies.size() * kBlock > distance_.size();
  if (strips_ || !is_vertical() || !pin_steps_.empty() || is_dense) {
    pool.parallel_for_rows(
        rows_, kHeightCost_ns * static_cast<double>(distance_.size()),
        [this, &params](int begin, int end) { update_row_height_bounds(params.height, begin, end); });
    params.max_pin_height = std::ranges::max(row_max_height_);
    params.job.min_start_z = ray_.origin.z() + (ray_.from_top ? std::ranges::min(row_min_height_) : 0.0F);
    params.job.max_start_z = ray_.origin.z() + (ray_.from_top ? params.max_pin_height : 0.0F);
  }
  if (strips_) {
    cast_strips(params, pool);
    return;
  }
  params.job.height = ray_.from_top ? height.data() : nullptr;
  params.job.distance = distance_.data();
  params.job.tag = tag_data();
  params.job.dirty_blocks = dirty_blocks_.data();
  params.job.x = x_.data();
  const int bands = pool.thread_count();
  partition_rows(bodies, bands);
  const auto cast_bands = [this, &params](int begin, int end) {
    const int first_row = band_first_row_[begin];
    const int end_row = band_first_row_[end];
    const auto prepare = [this, &params](int first, int last) {
      clear_rows(first, last);
      cast_rows_to_pins(params, first, last);
    };
    cast_rows(params.job, first_row, end_row, std::cref(prepare));
  };
  const auto cast_band = [&cast_bands](int band) { cast_bands(band, band + 1); };
  const auto cast_all = [&cast_bands, bands] { cast_bands(0, bands); };
  if (pool.pays(cost_ns(bodies.size())))
    pool.fork_join_or(cast_band, cast_all);
  else
    cast_all();
}

// The bodies are sorted from north to south, so the cost down to a row follows from a binary search.
void RayCaster::partition_rows(std::span<const RayBody> bodies, int bands) {
  band_first_row_.assign(bands + 1, rows_);
  band_first_row_.front() = 0;
  if (bands == 1) return;
  const double row_ns = (kEmptyCellCost_ns + kPinCost_ns * static_cast<double>(pin_steps_.size())) * columns_;
  const auto cost_to = [&](int row) {
    const float y = static_cast<float>(rows_ - 1 - row) * pitch_;
    const auto south =
        std::ranges::partition_point(bodies, [y](const RayBody& b) { return b.centre.y() > y; });
    return row_ns * row + kBodyCost_ns * static_cast<double>(south - bodies.begin());
  };
  const double total_ns = cost_to(rows_);
  for (int band = 1; band < bands; ++band) {
    int first = 0;
    for (int end = rows_; first < end;) {
      const int middle = first + (end - first) / 2;
      if (cost_to(middle) * bands < total_ns * band)
        first = middle + 1;
      else
        end = middle;
    }
    band_first_row_[band] = first;
  }
}

void RayCaster::update_row_height_bounds(const float* height, int begin, int end) noexcept {
  for (int r = begin; r < end; ++r) {
    const float* const h = height + r * columns_;
    // Lanes for the compiler's vectors, which it may not make of one minimum: that would change the order.
    constexpr int kWidth = 8;
    float low[kWidth], high[kWidth];
    std::fill_n(low, kWidth, kFar), std::fill_n(high, kWidth, -kFar);
    const auto add = [&](int lane, float cell) {
      const float present = cell > -kFar ? cell : kFar;
      low[lane] = present < low[lane] ? present : low[lane];
      high[lane] = cell > high[lane] ? cell : high[lane];
    };
    int c = 0;
    for (; c + kWidth <= columns_; c += kWidth)
      for (int lane = 0; lane < kWidth; ++lane) add(lane, h[c + lane]);
    for (; c < columns_; ++c) add(0, h[c]);
    row_min_height_[r] = *std::ranges::min_element(low);
    row_max_height_[r] = *std::ranges::max_element(high);
  }
}

// Calls visit(b) for every dirty block of a row, skipping eight clean blocks at a time.
template <class Use>
void RayCaster::for_each_dirty_block(int row, Use visit) noexcept {
  constexpr std::size_t kWordBytes = sizeof(std::uint64_t);
  const std::size_t blocks = blocks_;
  const std::uint8_t* const dirty = dirty_blocks_.data() + row * blocks;
  for (std::size_t b = 0; b < blocks;) {
    std::uint64_t next = 1;
    if (b + kWordBytes <= blocks) std::memcpy(&next, dirty + b, kWordBytes);
    const std::size_t end = std::min(b + kWordBytes, blocks);
    if (next == 0) b = end;
    for (; b < end; ++b)
      if (dirty[b] != 0) visit(b);
  }
}

void RayCaster::clear_rows(int begin, int end) noexcept {
  for (int r = begin; r < end; ++r) {
    const std::size_t columns = columns_, row = r * columns;
    std::uint8_t* const dirty = dirty_blocks_.data() + r * blocks_;
    for_each_dirty_block(r, [this, row, columns, dirty](std::size_t b) {
      if ((dirty[b] & 1) != 0) {
        const std::size_t first = b * kBlock;
        const std::size_t count = std::min<std::size_t>(kBlock, columns - first);
        std::fill_n(distance_.data() + row + first, count, ray_.range);
        std::fill_n(tag_data() + row + first, count, 0.0F);
      }
      dirty[b] = static_cast<std::uint8_t>((dirty[b] & 1) << 1);
    });
  }
}

void RayCaster::cast_rows_to_pins(const CastParams& params, int begin, int end) noexcept {
  const float dz = ray_.direction.z(), origin_z = ray_.origin.z();
  for (int r = begin; r < end; ++r) {
    bool any_hit = false;
    const int row = r * columns_;
    const float min_start_z = origin_z + (ray_.from_top ? row_min_height_[r] : 0.0F);
    for (const PinStep& step : pin_steps_) {
      if (dz >= 0.0F && !(min_start_z + dz * step.t_enter < params.max_pin_height))
        break;  // the ray is above all pins from here on
      const int pin_row = r + step.row_offset;
      if (pin_row < 0 || pin_row >= rows_) continue;
      const float rise = dz * (dz < 0.0F ? step.t_exit : step.t_enter);
      if (!(min_start_z + rise < row_max_height_[pin_row])) continue;
      const int first = std::max(0, -step.column_offset), last = columns_ - std::max(0, step.column_offset);
      const float* const pins = params.height + pin_row * columns_;
      const PinRowRays pin_row_rays{ray_.from_top ? params.height + row + first : nullptr,
                                    origin_z,
                                    pins + first + step.column_offset,
                                    distance_.data() + row + first,
                                    tag_data() + row + first,
                                    last - first};
      any_hit |= cast_to_pins(pin_row_rays, step, dz, ray_.range, params.pin_tag);
    }
    if (any_hit)
      for (int b = 0; b < blocks_; ++b) dirty_blocks_[r * blocks_ + b] |= 1;
  }
}

}  // namespace smartsurf::surface
