// RayCaster for free layouts: cells of any position and rotation, sorted into strips.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/raycast/RayCaster.h"
#include "smartsurf/surface/raycast/SlabClip.h"

namespace smartsurf::surface {
namespace {

// Pins farther away do not block a ray; in pitches. Keeps the pin lists from growing quadratically with the
// number of cells.
constexpr float kMaxPinDistance = 32.0F;
// Per cell, to copy its values to strip order and back.
constexpr double kGatherCost_ns = 3.0;

struct PlanarRotation {
  float cosine, sine;
  explicit PlanarRotation(float angle) : cosine(std::cos(angle)), sine(std::sin(angle)) {}
  float rotate_x(float u, float v) const { return u * cosine - v * sine; }
  float rotate_y(float u, float v) const { return u * sine + v * cosine; }
};

float angle_of(const Field& field, std::size_t cell) {
  return field.angle.empty() ? 0.0F : field.angle[cell];
}

}  // namespace

void RayCaster::build_strips(const Field& field) {
  StripLayout s;
  const std::size_t cells = field.x.size();
  s.height = 4.0F * pitch_;
  s.south = cells > 0 ? *std::ranges::min_element(field.y) - ray_.origin.norm() : 0.0F;
  const float north = cells > 0 ? *std::ranges::max_element(field.y) + ray_.origin.norm() : 0.0F;
  const auto strips = static_cast<std::size_t>((north - s.south) / s.height) + 1;

  std::vector<float> x(cells), y(cells);
  std::vector<std::size_t> strip(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    const PlanarRotation rotation(angle_of(field, i));
    x[i] = field.x[i] + rotation.rotate_x(ray_.origin.x(), ray_.origin.y());
    y[i] = field.y[i] + rotation.rotate_y(ray_.origin.x(), ray_.origin.y());
    strip[i] = std::min(strips - 1, static_cast<std::size_t>(std::max(0.0F, (y[i] - s.south) / s.height)));
  }
  // Sort the cells by strip, then by x.
  s.cell.resize(cells);
  std::iota(s.cell.begin(), s.cell.end(), 0);
  std::ranges::stable_sort(
      s.cell, [&](int a, int b) { return strip[a] != strip[b] ? strip[a] < strip[b] : x[a] < x[b]; });
  s.first.assign(strips + 1, 0);
  for (const int i : s.cell) {
    const PlanarRotation rotation(angle_of(field, i));
    s.x.push_back(x[i]);
    s.y.push_back(y[i]);
    s.dx.push_back(rotation.rotate_x(ray_.direction.x(), ray_.direction.y()));
    s.dy.push_back(rotation.rotate_y(ray_.direction.x(), ray_.direction.y()));
    s.max_abs_dx = std::max(s.max_abs_dx, std::abs(s.dx.back()));
    s.max_abs_dy = std::max(s.max_abs_dy, std::abs(s.dy.back()));
    ++s.first[strip[i] + 1];
  }
  std::partial_sum(s.first.begin(), s.first.end(), s.first.begin());
  strips_ = std::move(s);
  strip_height_.resize(cells);
  strip_distance_.resize(cells);
  strip_tag_.resize(cells);
}

// Lists, for each ray in strip order, the pins that it passes and where, ordered by t_enter.
void RayCaster::build_pin_intervals(const Field& field) {
  const StripLayout& s = *strips_;
  const float half = std::hypot(field.half_top_x, field.half_top_y);
  const float horizontal = ray_.direction.head<2>().norm();
  const float range =
      horizontal * ray_.range > kMaxPinDistance * pitch_ ? kMaxPinDistance * pitch_ / horizontal : ray_.range;
  // The strips are sorted by ray origin, which is offset from the centre of its pin.
  const float margin = half + 2.0F * ray_.origin.head<2>().norm();
  first_pin_interval_.push_back(0);
  for (std::size_t k = 0; k < s.cell.size(); ++k) {
    const float to_x = s.x[k] + s.dx[k] * range, to_y = s.y[k] + s.dy[k] * range;
    const float low_y = std::min(s.y[k], to_y) - margin, high_y = std::max(s.y[k], to_y) + margin;
    const float low_x = std::min(s.x[k], to_x) - margin, high_x = std::max(s.x[k], to_x) + margin;
    const auto begin = pin_intervals_.size();
    for (std::size_t strip = 0; strip + 1 < s.first.size(); ++strip) {
      const float south = s.south + static_cast<float>(strip) * s.height;
      if (south > high_y || south + s.height < low_y) continue;
      const auto from = s.x.begin() + s.first[strip], to = s.x.begin() + s.first[strip + 1];
      for (auto it = std::lower_bound(from, to, low_x); it != to && *it <= high_x; ++it) {
        const int cell = s.cell[it - s.x.begin()];
        if (cell == s.cell[k] && clears_own_pin()) continue;
        const PlanarRotation to_pin_frame(-angle_of(field, cell));
        const float px = s.x[k] - field.x[cell], py = s.y[k] - field.y[cell];
        TInterval t{0.0F, range};
        if (clip_slab(to_pin_frame.rotate_x(px, py), to_pin_frame.rotate_x(s.dx[k], s.dy[k]),
                      field.half_top_x, t) &&
            clip_slab(to_pin_frame.rotate_y(px, py), to_pin_frame.rotate_y(s.dx[k], s.dy[k]),
                      field.half_top_y, t))
          pin_intervals_.push_back({cell, t.t_enter, t.t_exit});
      }
    }
    std::stable_sort(pin_intervals_.begin() + begin, pin_intervals_.end(),
                     [](const PinInterval& a, const PinInterval& b) { return a.t_enter < b.t_enter; });
    first_pin_interval_.push_back(static_cast<int>(pin_intervals_.size()));
  }
}

void RayCaster::cast_strips(CastParams& params, common::ThreadPool& pool) {
  RayCastJob& job = params.job;
  job.strips = &*strips_;
  job.height = ray_.from_top ? strip_height_.data() : nullptr;
  job.distance = strip_distance_.data();
  job.tag = strip_tag_.data();
  const double cost = cost_ns(job.bodies.size()) + kGatherCost_ns * static_cast<double>(distance_.size());
  pool.parallel_for_rows(static_cast<int>(strips_->first.size()) - 1, cost,
                         [this, &params](int begin, int end) {
                           const StripLayout& s = *strips_;
                           const std::size_t first = s.first[begin];
                           const std::size_t last = s.first[end];
                           // Gather the cells in strip order and test their pins.
                           for (std::size_t k = first; k < last; ++k) {
                             strip_height_[k] = params.height[s.cell[k]];
                             strip_distance_[k] = ray_.range;
                             strip_tag_[k] = 0.0F;
                             if (!first_pin_interval_.empty()) cast_cell_to_pins(params, k);
                           }
                           cast_rows(params.job, begin, end, [](int, int) {});
                           // Scatter the results to field order.
                           for (std::size_t k = first; k < last; ++k) {
                             distance_[s.cell[k]] = strip_distance_[k];
                             tag_data()[s.cell[k]] = strip_tag_[k];
                           }
                         });
}

// cast_to_pins() for one cell.
void RayCaster::cast_cell_to_pins(const CastParams& params, std::size_t k) noexcept {
  if (strip_height_[k] == kNoCellHeight && ray_.from_top) return;
  const float start = ray_.origin.z() + (ray_.from_top ? strip_height_[k] : 0.0F);
  const float dz = ray_.direction.z();
  for (int i = first_pin_interval_[k]; i < first_pin_interval_[k + 1]; ++i) {
    const PinInterval& p = pin_intervals_[i];
    const float pin_height = params.height[p.cell];
    float t_hit = p.t_enter;
    if (!(start + dz * p.t_enter < pin_height)) {
      if (!(dz < 0.0F && start + dz * p.t_exit < pin_height)) continue;
      t_hit = std::max(p.t_enter, (pin_height - start) / dz);
    }
    if (t_hit > ray_.range || t_hit >= strip_distance_[k]) continue;
    strip_distance_[k] = t_hit;
    strip_tag_[k] = params.pin_tag;
  }
}

}  // namespace smartsurf::surface
