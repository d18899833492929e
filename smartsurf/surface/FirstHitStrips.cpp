// Free layouts: cells that stand and are turned as they like, sorted into strips.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartsurf/surface/FirstHit.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

// Of pins, in pitches: the lists of all cells must not grow with the square of the table.
constexpr float kFarthest = 32.0F;
// Of one cell into the order of the strips and back.
constexpr double kGather_ns = 3.0;

struct Turn {
  float cosine, sine;
  explicit Turn(float angle) : cosine(std::cos(angle)), sine(std::sin(angle)) {}
  float x(float u, float v) const { return u * cosine - v * sine; }
  float y(float u, float v) const { return u * sine + v * cosine; }
};

float angle_of(const Field& field, std::size_t cell) {
  return field.angle.empty() ? 0.0F : field.angle[cell];
}

bool clip(float from, float along, float half, float& enter, float& leave) {
  if (along == 0.0F) return std::abs(from) <= half;
  const float a = (-half - from) / along, b = (half - from) / along;
  enter = std::max(enter, std::min(a, b));
  leave = std::min(leave, std::max(a, b));
  return enter <= leave;
}

}  // namespace

void FirstHit::list_strips(const Field& field) {
  StripLayout s;
  const std::size_t cells = field.x.size();
  s.height = 4.0F * pitch_;
  s.south = cells > 0 ? *std::ranges::min_element(field.y) - segment_.origin.norm() : 0.0F;
  const float north = cells > 0 ? *std::ranges::max_element(field.y) + segment_.origin.norm() : 0.0F;
  const auto strips = static_cast<std::size_t>((north - s.south) / s.height) + 1;

  std::vector<float> x(cells), y(cells);
  std::vector<std::size_t> strip(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    const Turn turn(angle_of(field, i));
    x[i] = field.x[i] + turn.x(segment_.origin.x(), segment_.origin.y());
    y[i] = field.y[i] + turn.y(segment_.origin.x(), segment_.origin.y());
    strip[i] = std::min(strips - 1, static_cast<std::size_t>(std::max(0.0F, (y[i] - s.south) / s.height)));
  }
  s.cell.resize(cells);
  std::iota(s.cell.begin(), s.cell.end(), 0);
  std::ranges::stable_sort(s.cell, [&](int a, int b) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    return strip[i] != strip[j] ? strip[i] < strip[j] : x[i] < x[j];
  });
  s.first.assign(strips + 1, 0);
  for (const int cell : s.cell) {
    const auto i = static_cast<std::size_t>(cell);
    const Turn turn(angle_of(field, i));
    s.x.push_back(x[i]);
    s.y.push_back(y[i]);
    s.dx.push_back(turn.x(segment_.direction.x(), segment_.direction.y()));
    s.dy.push_back(turn.y(segment_.direction.x(), segment_.direction.y()));
    s.longest_x = std::max(s.longest_x, std::abs(s.dx.back()));
    s.longest_y = std::max(s.longest_y, std::abs(s.dy.back()));
    ++s.first[strip[i] + 1];
  }
  std::partial_sum(s.first.begin(), s.first.end(), s.first.begin());
  strips_ = std::move(s);
  strip_height_.resize(cells);
  strip_distance_.resize(cells);
  strip_mark_.resize(cells);
}

// Every pin near each segment's way, by strips; the way of a segment is short against the table, or the list
// is long.
void FirstHit::list_pins_of_each_cell(const Field& field) {
  const StripLayout& s = *strips_;
  const float half = std::hypot(field.half_top_x, field.half_top_y);
  const float level = segment_.direction.head<2>().norm();
  const float range =
      level * segment_.range > kFarthest * pitch_ ? kFarthest * pitch_ / level : segment_.range;
  const float margin =
      half + 2.0F * segment_.origin.head<2>().norm();  // a pin's centre is not where its segment starts
  first_passed_.push_back(0);
  for (std::size_t k = 0; k < s.cell.size(); ++k) {
    const float to_x = s.x[k] + s.dx[k] * range, to_y = s.y[k] + s.dy[k] * range;
    const float low_y = std::min(s.y[k], to_y) - margin, high_y = std::max(s.y[k], to_y) + margin;
    const float low_x = std::min(s.x[k], to_x) - margin, high_x = std::max(s.x[k], to_x) + margin;
    const auto begin = passed_.size();
    for (std::size_t strip = 0; strip + 1 < s.first.size(); ++strip) {
      const float south = s.south + static_cast<float>(strip) * s.height;
      if (south > high_y || south + s.height < low_y) continue;
      const auto from = s.x.begin() + s.first[strip], to = s.x.begin() + s.first[strip + 1];
      for (auto it = std::lower_bound(from, to, low_x); it != to && *it <= high_x; ++it) {
        const int cell = s.cell[static_cast<std::size_t>(it - s.x.begin())];
        const auto i = static_cast<std::size_t>(cell);
        if (cell == s.cell[k] && clears_its_own_pin()) continue;
        const Turn back(-angle_of(field, i));
        const float px = s.x[k] - field.x[i], py = s.y[k] - field.y[i];
        PassedPin p{cell, 0.0F, range};
        if (clip(back.x(px, py), back.x(s.dx[k], s.dy[k]), field.half_top_x, p.enter, p.leave) &&
            clip(back.y(px, py), back.y(s.dx[k], s.dy[k]), field.half_top_y, p.enter, p.leave))
          passed_.push_back(p);
      }
    }
    std::stable_sort(passed_.begin() + static_cast<std::ptrdiff_t>(begin), passed_.end(),
                     [](const PassedPin& a, const PassedPin& b) { return a.enter < b.enter; });
    first_passed_.push_back(static_cast<int>(passed_.size()));
  }
}

void FirstHit::sweep_strips(Pass& pass, WorkerPool& pool) {
  SweepJob& job = pass.job;
  job.strips = &*strips_;
  job.height = segment_.from_top ? strip_height_.data() : nullptr;
  job.distance = strip_distance_.data();
  job.mark = strip_mark_.data();
  const double cost = cost_ns(job.bodies.size()) + kGather_ns * static_cast<double>(distance_.size());
  pool.for_rows(static_cast<int>(strips_->first.size()) - 1, cost, [this, &pass](int begin, int end) {
    const StripLayout& s = *strips_;
    const auto first = static_cast<std::size_t>(s.first[static_cast<std::size_t>(begin)]);
    const auto last = static_cast<std::size_t>(s.first[static_cast<std::size_t>(end)]);
    for (std::size_t k = first; k < last; ++k) {
      strip_height_[k] = pass.height[s.cell[k]];
      strip_distance_[k] = segment_.range;
      strip_mark_[k] = 0.0F;
      if (!first_passed_.empty()) meet_pins_of_cell(pass, k);
    }
    sweep_rows(pass.job, begin, end, [](int, int) {});
    for (std::size_t k = first; k < last; ++k) {
      distance_[static_cast<std::size_t>(s.cell[k])] = strip_distance_[k];
      first_mark()[s.cell[k]] = strip_mark_[k];
    }
  });
}

// As meet_pins, for one cell.
void FirstHit::meet_pins_of_cell(const Pass& pass, std::size_t k) noexcept {
  if (strip_height_[k] == kNoCell && segment_.from_top) return;
  const float start = segment_.origin.z() + (segment_.from_top ? strip_height_[k] : 0.0F);
  const float rise = segment_.direction.z();
  for (int i = first_passed_[k]; i < first_passed_[k + 1]; ++i) {
    const PassedPin& p = passed_[static_cast<std::size_t>(i)];
    const float pin = pass.height[p.cell];
    float reached = p.enter;
    if (!(start + rise * p.enter < pin)) {
      if (!(rise < 0.0F && start + rise * p.leave < pin)) continue;
      reached = std::max(p.enter, (pin - start) / rise);
    }
    if (reached > segment_.range || reached >= strip_distance_[k]) continue;
    strip_distance_[k] = reached;
    strip_mark_[k] = pass.pin_mark;
  }
}

}  // namespace smartsurf::surface
