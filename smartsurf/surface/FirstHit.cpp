#include "smartsurf/surface/FirstHit.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

// What things cost, about: a look at a cell's height, a body under some twenty cells, a pin on the way of a
// segment, a cell under nothing.
constexpr double kLook_ns = 0.2, kBody_ns = 80.0, kPin_ns = 0.3, kRow_ns = 0.01;

// Between which distances a ray is within a rectangle about the origin; enter > leave where it passes by.
struct Passage {
  float enter, leave;
};
void clip(float from, float along, float half, Passage& p) {
  if (along == 0.0F) {
    if (std::abs(from) > half) p.leave = -kFar;
    return;
  }
  const float a = (-half - from) / along, b = (half - from) / along;
  p.enter = std::max(p.enter, std::min(a, b));
  p.leave = std::min(p.leave, std::max(a, b));
}

// The numbers of the cells, from the one that the segment starts in, whose centre's coordinate lies in [low,
// high].
std::pair<int, int> cells_between(float low, float high, float pitch, int most) {
  const auto limit = static_cast<float>(most);
  return {static_cast<int>(std::ceil(std::clamp(low / pitch, -limit, limit))),
          static_cast<int>(std::floor(std::clamp(high / pitch, -limit, limit)))};
}

}  // namespace

FirstHit::FirstHit(const Field& field, const Segment& segment)
    : rows_(field.rows),
      columns_(field.columns),
      blocks_((field.columns + kBlock - 1) / kBlock),
      pitch_(field.pitch),
      segment_(segment),
      distance_(static_cast<std::size_t>(field.cells()), segment.range),
      mark_(kApart + distance_.size(), 0.0F),
      touched_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(blocks_),
               field.rectangular() ? 0 : 1),
      row_lowest_(static_cast<std::size_t>(rows_)),
      row_highest_(row_lowest_.size()) {
  if (!field.rectangular()) {
    list_strips(field);
    if (segment.pins) list_pins_of_each_cell(field);
    return;
  }
  for (int c = 0; c < columns_; ++c) x_.push_back(static_cast<float>(c) * pitch_ + segment.origin.x());
  if (segment.pins) list_pins(field);
}

bool FirstHit::upright() const noexcept {
  return segment_.direction.x() == 0.0F && segment_.direction.y() == 0.0F;
}

double FirstHit::cost_ns(std::size_t bodies) const noexcept {
  const double pins = strips_ ? static_cast<double>(passed_.size())
                              : static_cast<double>(pins_.size()) * static_cast<double>(distance_.size());
  return kBody_ns * static_cast<double>(bodies) + kPin_ns * pins;
}

// Whether a segment from a cell's own top can never come below it.
bool FirstHit::clears_its_own_pin() const noexcept {
  return segment_.from_top && segment_.direction.z() >= 0.0F && segment_.origin.z() >= 0.0F;
}

// Row by row of pins: between which distances the segment is over that row, and over which columns then.
void FirstHit::list_pins(const Field& field) {
  const Eigen::Vector3f& o = segment_.origin;
  const Eigen::Vector3f& d = segment_.direction;
  const float reach = segment_.range * std::abs(d.y()) + field.half_top_y;
  const auto [south, north] = cells_between(o.y() - reach, o.y() + reach, pitch_, rows_ - 1);
  for (int j = south; j <= north; ++j) {
    Passage row{0.0F, segment_.range};
    clip(o.y() - static_cast<float>(j) * pitch_, d.y(), field.half_top_y, row);
    if (row.enter > row.leave) continue;
    const float a = o.x() + d.x() * row.enter, b = o.x() + d.x() * row.leave;
    const auto [west, east] = cells_between(std::min(a, b) - field.half_top_x,
                                            std::max(a, b) + field.half_top_x, pitch_, columns_ - 1);
    for (int i = west; i <= east; ++i) {
      if (i == 0 && j == 0 && clears_its_own_pin()) continue;
      Passage pin = row;
      clip(o.x() - static_cast<float>(i) * pitch_, d.x(), field.half_top_x, pin);
      if (pin.enter <= pin.leave) pins_.push_back({-j, i, pin.enter, pin.leave});
    }
  }
  std::ranges::stable_sort(pins_, {}, &PinStep::enter);
}

void FirstHit::sweep(const SensedBodies& bodies, std::span<const float> marks, float pin_mark,
                     std::span<const float> height, WorkerPool& pool) {
  assert(height.size() == distance_.size() && marks.size() == bodies.size());
  Pass pass{.job = {.bodies = bodies,
                    .marks = marks,
                    .bundles = bodies.bundles(),
                    .origin = segment_.origin,
                    .direction = segment_.direction,
                    .range = segment_.range,
                    .rows = rows_,
                    .columns = columns_,
                    .blocks = blocks_,
                    .pitch = pitch_},
            .height = height.data(),
            .pin_mark = pin_mark};
  // Where many objects lie on top of each other, knowing the heights spares those that nothing reaches.
  const bool piled = bodies.size() * kBlock > distance_.size();
  if (strips_ || !upright() || !pins_.empty() || piled) {
    pool.for_rows(rows_, kLook_ns * static_cast<double>(distance_.size()),
                  [this, &pass](int begin, int end) { find_extremes(pass.height, begin, end); });
    pass.highest_pin = std::ranges::max(row_highest_);
    pass.job.lowest = segment_.origin.z() + (segment_.from_top ? std::ranges::min(row_lowest_) : 0.0F);
    pass.job.highest = segment_.origin.z() + (segment_.from_top ? pass.highest_pin : 0.0F);
  }
  if (strips_) {
    sweep_strips(pass, pool);
    return;
  }
  pass.job.height = segment_.from_top ? height.data() : nullptr;
  pass.job.distance = distance_.data();
  pass.job.mark = first_mark();
  pass.job.touched = touched_.data();
  pass.job.x = x_.data();
  const int bands = pool.threads();
  cut_bands(bodies, bands);
  // Two rows a band: the pool keeps anything smaller on the caller.
  pool.for_rows(2 * bands, cost_ns(bodies.size()), [this, &pass](int begin, int end) {
    const int first_row = band_first_[static_cast<std::size_t>(begin / 2)];
    const int end_row = band_first_[static_cast<std::size_t>(end / 2)];
    const auto prepare = [this, &pass, end_row](int first, int last) {
      clear_rows(first, last, end_row);
      meet_pins_of_rows(pass, first, last);
    };
    sweep_rows(pass.job, first_row, end_row, std::cref(prepare));
  });
}

// The bodies come from north to south, near enough to weigh the rows down to any of them.
void FirstHit::cut_bands(std::span<const SensedBody> bodies, int bands) {
  band_first_.assign(static_cast<std::size_t>(bands) + 1, rows_);
  band_first_.front() = 0;
  const double row_ns = (kRow_ns + kPin_ns * static_cast<double>(pins_.size())) * columns_;
  const auto cost_to = [&](int row) {
    const float y = static_cast<float>(rows_ - 1 - row) * pitch_;
    const auto south =
        std::ranges::partition_point(bodies, [y](const SensedBody& b) { return b.centre.y() > y; });
    return row_ns * row + kBody_ns * static_cast<double>(south - bodies.begin());
  };
  const double all_ns = cost_to(rows_);
  for (int band = 1; band < bands; ++band) {
    int first = 0;
    for (int end = rows_; first < end;) {
      const int middle = first + (end - first) / 2;
      if (cost_to(middle) * bands < all_ns * band)
        first = middle + 1;
      else
        end = middle;
    }
    band_first_[static_cast<std::size_t>(band)] = first;
  }
}

void FirstHit::find_extremes(const float* height, int begin, int end) noexcept {
  for (int r = begin; r < end; ++r) {
    const float* const h = height + static_cast<std::ptrdiff_t>(r) * columns_;
    float low = kFar, high = -kFar;
    for (int c = 0; c < columns_; ++c) {
      const float there = h[c] > -kFar ? h[c] : kFar;
      low = there < low ? there : low;
      high = h[c] > high ? h[c] : high;
    }
    row_lowest_[static_cast<std::size_t>(r)] = low;
    row_highest_[static_cast<std::size_t>(r)] = high;
  }
}

// Calls use(b) for every block of a row that was touched, eight at a look.
template <class Use>
void FirstHit::for_touched(int row, Use use) noexcept {
  constexpr std::size_t kWord = sizeof(std::uint64_t);
  const auto blocks = static_cast<std::size_t>(blocks_);
  const std::uint8_t* const touched = touched_.data() + static_cast<std::size_t>(row) * blocks;
  for (std::size_t b = 0; b < blocks;) {
    std::uint64_t next = 1;
    if (b + kWord <= blocks) std::memcpy(&next, touched + b, kWord);
    const std::size_t end = std::min(b + kWord, blocks);
    if (next == 0) b = end;
    for (; b < end; ++b)
      if (touched[b] != 0) use(b);
  }
}

void FirstHit::clear_rows(int begin, int end, int end_of_band) noexcept {
  constexpr int kAhead = 2;  // rows: about what a trip to memory takes
  for (int r = begin; r < end; ++r) {
    const std::size_t row = static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_);
    if (r + kAhead < end_of_band) {
      const std::size_t ahead = row + kAhead * static_cast<std::size_t>(columns_);
      for_touched(r + kAhead, [this, ahead](std::size_t b) {
        hwy::Prefetch(&distance_[ahead + b * kBlock]);
        hwy::Prefetch(first_mark() + ahead + b * kBlock);
      });
    }
    std::uint8_t* const touched = touched_.data() + static_cast<std::ptrdiff_t>(r) * blocks_;
    for_touched(r, [this, row, touched](std::size_t b) {
      if ((touched[b] & 1) != 0) {
        const std::size_t first = b * kBlock;
        const std::size_t count = std::min<std::size_t>(kBlock, static_cast<std::size_t>(columns_) - first);
        std::fill_n(distance_.begin() + static_cast<std::ptrdiff_t>(row + first), count, segment_.range);
        std::fill_n(first_mark() + row + first, count, 0.0F);
      }
      touched[b] = static_cast<std::uint8_t>((touched[b] & 1) << 1);
    });
  }
}

void FirstHit::meet_pins_of_rows(const Pass& pass, int begin, int end) noexcept {
  const float rise = segment_.direction.z(), lift = segment_.origin.z();
  for (int r = begin; r < end; ++r) {
    bool any = false;
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(r) * columns_;
    const float lowest = lift + (segment_.from_top ? row_lowest_[static_cast<std::size_t>(r)] : 0.0F);
    for (const PinStep& step : pins_) {
      if (rise >= 0.0F && !(lowest + rise * step.enter < pass.highest_pin))
        break;  // above all pins from here on
      const int passed = r + step.row_offset;
      if (passed < 0 || passed >= rows_) continue;
      const float reached = rise * (rise < 0.0F ? step.leave : step.enter);
      if (!(lowest + reached < row_highest_[static_cast<std::size_t>(passed)])) continue;
      const int first = std::max(0, -step.column_offset), last = columns_ - std::max(0, step.column_offset);
      const float* const pins = pass.height + static_cast<std::ptrdiff_t>(passed) * columns_;
      const PinRow cells{segment_.from_top ? pass.height + row + first : nullptr,
                         lift,
                         pins + first + step.column_offset,
                         distance_.data() + row + first,
                         first_mark() + row + first,
                         last - first};
      any |= meet_pins(cells, step, rise, segment_.range, pass.pin_mark);
    }
    if (any)
      for (int b = 0; b < blocks_; ++b) touched_[static_cast<std::size_t>(r * blocks_ + b)] |= 1;
  }
}

}  // namespace smartsurf::surface
