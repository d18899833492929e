#include "smartsurf/surface/Tiles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::surface {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
// Halved after the last vibration: in the step that follows the cells return to rest, in the next their speed
// is 0.
constexpr std::uint8_t kAwake = 4;

// The run of each cell, −1 for those of others.
std::vector<int> run_of_cells(const Place& place) {
  std::vector<int> run_of(place.field.height.size(), -1);
  for (std::size_t r = 0; r < place.runs.size(); ++r)
    std::fill(run_of.begin() + place.runs[r].begin, run_of.begin() + place.runs[r].end, static_cast<int>(r));
  return run_of;
}

}  // namespace

Tiles::Tiles(const Place& place)
    : columns_(place.field.columns),
      share_(static_cast<float>(place.spec.number("skin"))),
      half_thickness_(static_cast<float>(place.spec.number("thickness") / 2.0)),
      pitch_(place.field.pitch),
      most_(static_cast<float>(place.spec.number("max_amplitude"))),
      frequency_hz_(place.spec.number("frequency")),
      phase_(place, 0.0F, 1e30, place.spec.number("lag")),
      amplitude_(place, 0.0F, 1e30, place.spec.number("lag")),
      base_(place.field.height),
      own_(base_.size(), 0.0F),
      next_height_(base_),
      neighbour_(base_.size()),
      awake_(place.runs.size(), 0),
      touching_(place.runs.size()) {
  const std::vector<int> run_of = run_of_cells(place);
  for (std::size_t r = 0; r < place.runs.size(); ++r) {
    touching_[r].push_back(r);
    for (int i = place.runs[r].begin; i < place.runs[r].end; ++i) {
      const int column = i % columns_, cells = place.field.cells();
      auto joined = [&](bool inside, int other) {
        if (!inside || run_of[static_cast<std::size_t>(other)] < 0) return i;
        const auto run = static_cast<std::size_t>(run_of[static_cast<std::size_t>(other)]);
        if (std::ranges::find(touching_[r], run) == touching_[r].end()) touching_[r].push_back(run);
        return other;
      };
      neighbour_[static_cast<std::size_t>(i)] = {
          joined(column > 0, i - 1), joined(column + 1 < columns_, i + 1),
          joined(i + columns_ < cells, i + columns_), joined(i >= columns_, i - columns_)};
    }
  }
}

void Tiles::set_targets(int channel, std::span<const float> targets) noexcept {
  (channel == 0 ? phase_ : amplitude_).set_targets(targets);
}

bool Tiles::vibrates(std::size_t run) const noexcept {
  for (int i = phase_.runs()[run].begin; i < phase_.runs()[run].end; ++i)
    if (amplitude_[i] != 0.0F) return true;
  return false;
}

void Tiles::settle(Field& field) noexcept {
  phase_.settle();
  amplitude_.settle();
  excite(0.0);
  for (const Run& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i) {
      const auto cell = static_cast<std::size_t>(i);
      field.height[cell] = next_height_[cell] = base_[cell] + skin(i);
    }
  std::ranges::fill(awake_, kAwake);
}

void Tiles::excite(double time_s) noexcept {
  const auto turned = static_cast<float>(std::remainder(kTurn * frequency_hz_ * time_s, kTurn));
  for (const Run& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i) {
      if (amplitude_[i] == 0.0F && own_[static_cast<std::size_t>(i)] == 0.0F) continue;
      own_[static_cast<std::size_t>(i)] = amplitude_[i] * std::sin(turned - phase_[i]);
    }
}

float Tiles::skin(int cell) const noexcept {
  const auto& n = neighbour_[static_cast<std::size_t>(cell)];
  float sum = 0.0F;
  for (const int other : n) sum += own_[static_cast<std::size_t>(other)];
  return (1.0F - share_) * own_[static_cast<std::size_t>(cell)] + share_ * 0.25F * sum;
}

void Tiles::plan(double dt_s, Field& field) noexcept {
  phase_.step(dt_s);
  amplitude_.step(dt_s);
  time_s_ += dt_s;
  excite(time_s_);
  const auto inverse_dt = static_cast<float>(1.0 / dt_s);
  const auto runs = phase_.runs();
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const bool moves =
        std::ranges::any_of(touching_[r], [this](std::size_t other) { return vibrates(other); });
    awake_[r] = static_cast<std::uint8_t>(moves ? kAwake : awake_[r] >> 1);
  }
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (int i = runs[r].begin; awake_[r] && i < runs[r].end; ++i) {
      const auto cell = static_cast<std::size_t>(i);
      next_height_[cell] = base_[cell] + skin(i);
      field.speed[cell] = (next_height_[cell] - field.height[cell]) * inverse_dt;
      field.max_height = std::max({field.max_height, next_height_[cell], field.height[cell]});
      field.max_speed = std::max(field.max_speed, std::abs(field.speed[cell]));
    }
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (int i = runs[r].begin; awake_[r] && i < runs[r].end; ++i) bend(i, field);
}

void Tiles::bend(int i, Field& field) noexcept {
  const auto& n = neighbour_[static_cast<std::size_t>(i)];
  auto slope = [&](int low, int high) {
    const int steps = static_cast<int>(low != i) + static_cast<int>(high != i);
    if (steps == 0) return 0.0F;
    return (field.speed[static_cast<std::size_t>(high)] - field.speed[static_cast<std::size_t>(low)]) /
           (static_cast<float>(steps) * pitch_);
  };
  field.drag_x[static_cast<std::size_t>(i)] = -half_thickness_ * slope(n[0], n[1]);
  field.drag_y[static_cast<std::size_t>(i)] = -half_thickness_ * slope(n[2], n[3]);
}

void Tiles::commit(double, Field& field) noexcept {
  const auto runs = phase_.runs();
  for (std::size_t r = 0; r < runs.size(); ++r)
    if (awake_[r])
      std::copy(next_height_.begin() + runs[r].begin, next_height_.begin() + runs[r].end,
                field.height.begin() + runs[r].begin);
}

void Tiles::show(std::span<scene::CellMotion> motion) const noexcept {
  for (const Run& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)].level = amplitude_[i] / most_;
}

}  // namespace smartsurf::surface
