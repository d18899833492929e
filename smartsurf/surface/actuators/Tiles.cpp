#include "smartsurf/surface/actuators/Tiles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::surface {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
// Halved in every step after the last vibration: the first such step returns the cells to rest height, the
// second sets their speed to 0.
constexpr std::uint8_t kActiveSteps = 4;

// Returns each cell's run index, or −1 for cells of other models.
std::vector<int> run_index_of_cells(const ActuatorContext& context) {
  std::vector<int> run_of(context.field.height.size(), -1);
  for (std::size_t r = 0; r < context.runs.size(); ++r)
    std::fill(run_of.begin() + context.runs[r].begin, run_of.begin() + context.runs[r].end,
              static_cast<int>(r));
  return run_of;
}

}  // namespace

Tiles::Tiles(const ActuatorContext& context)
    : columns_(context.field.columns),
      skin_coupling_(static_cast<float>(context.spec.number("skin"))),
      half_thickness_(static_cast<float>(context.spec.number("thickness") / 2.0)),
      pitch_(context.field.pitch),
      max_amplitude_(static_cast<float>(context.spec.number("max_amplitude"))),
      frequency_hz_(context.spec.number("frequency")),
      phase_(context, 0.0F, 1e30, context.spec.number("lag")),
      amplitude_(context, 0.0F, 1e30, context.spec.number("lag")),
      base_(context.field.height),
      excitation_(base_.size(), 0.0F),
      next_height_(base_),
      neighbour_(base_.size()),
      active_steps_(context.runs.size(), 0),
      coupled_runs_(context.runs.size()) {
  const std::vector<int> run_of = run_index_of_cells(context);
  for (std::size_t r = 0; r < context.runs.size(); ++r) {
    coupled_runs_[r].push_back(r);
    for (int i = context.runs[r].begin; i < context.runs[r].end; ++i) {
      const int column = i % columns_, cells = context.field.cells();
      auto neighbour_or_self = [&](bool inside, int other) {
        if (!inside || run_of[static_cast<std::size_t>(other)] < 0) return i;
        const auto run = static_cast<std::size_t>(run_of[static_cast<std::size_t>(other)]);
        if (std::ranges::find(coupled_runs_[r], run) == coupled_runs_[r].end())
          coupled_runs_[r].push_back(run);
        return other;
      };
      neighbour_[static_cast<std::size_t>(i)] = {neighbour_or_self(column > 0, i - 1),
                                                 neighbour_or_self(column + 1 < columns_, i + 1),
                                                 neighbour_or_self(i + columns_ < cells, i + columns_),
                                                 neighbour_or_self(i >= columns_, i - columns_)};
    }
  }
}

void Tiles::set_targets(int channel, std::span<const float> targets) noexcept {
  (channel == 0 ? phase_ : amplitude_).set_targets(targets);
}

bool Tiles::is_vibrating(std::size_t run) const noexcept {
  for (int i = phase_.runs()[run].begin; i < phase_.runs()[run].end; ++i)
    if (amplitude_[i] != 0.0F) return true;
  return false;
}

void Tiles::snap_to_targets(Field& field) noexcept {
  phase_.snap_to_targets();
  amplitude_.snap_to_targets();
  update_excitation(0.0);
  for (const CellRun& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i) {
      const auto cell = static_cast<std::size_t>(i);
      field.height[cell] = next_height_[cell] = base_[cell] + skin_height(i);
    }
  std::ranges::fill(active_steps_, kActiveSteps);
}

void Tiles::update_excitation(double time_s) noexcept {
  const auto omega_t = static_cast<float>(std::remainder(kTwoPi * frequency_hz_ * time_s, kTwoPi));
  for (const CellRun& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i) {
      if (amplitude_[i] == 0.0F && excitation_[static_cast<std::size_t>(i)] == 0.0F) continue;
      excitation_[static_cast<std::size_t>(i)] = amplitude_[i] * std::sin(omega_t - phase_[i]);
    }
}

float Tiles::skin_height(int cell) const noexcept {
  const auto& n = neighbour_[static_cast<std::size_t>(cell)];
  float sum = 0.0F;
  for (const int other : n) sum += excitation_[static_cast<std::size_t>(other)];
  return (1.0F - skin_coupling_) * excitation_[static_cast<std::size_t>(cell)] + skin_coupling_ * 0.25F * sum;
}

void Tiles::plan(double dt_s, Field& field) noexcept {
  phase_.step(dt_s);
  amplitude_.step(dt_s);
  time_s_ += dt_s;
  update_excitation(time_s_);
  const auto inverse_dt = static_cast<float>(1.0 / dt_s);
  const auto runs = phase_.runs();
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const bool moves =
        std::ranges::any_of(coupled_runs_[r], [this](std::size_t other) { return is_vibrating(other); });
    active_steps_[r] = static_cast<std::uint8_t>(moves ? kActiveSteps : active_steps_[r] >> 1);
  }
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (int i = runs[r].begin; active_steps_[r] && i < runs[r].end; ++i) {
      const auto cell = static_cast<std::size_t>(i);
      next_height_[cell] = base_[cell] + skin_height(i);
      field.speed[cell] = (next_height_[cell] - field.height[cell]) * inverse_dt;
      field.max_height = std::max({field.max_height, next_height_[cell], field.height[cell]});
      field.max_speed = std::max(field.max_speed, std::abs(field.speed[cell]));
    }
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (int i = runs[r].begin; active_steps_[r] && i < runs[r].end; ++i) update_surface_velocity(i, field);
}

void Tiles::update_surface_velocity(int i, Field& field) noexcept {
  const auto& n = neighbour_[static_cast<std::size_t>(i)];
  auto slope = [&](int low, int high) {
    const int steps = static_cast<int>(low != i) + static_cast<int>(high != i);
    if (steps == 0) return 0.0F;
    return (field.speed[static_cast<std::size_t>(high)] - field.speed[static_cast<std::size_t>(low)]) /
           (static_cast<float>(steps) * pitch_);
  };
  field.surface_velocity_x[static_cast<std::size_t>(i)] = -half_thickness_ * slope(n[0], n[1]);
  field.surface_velocity_y[static_cast<std::size_t>(i)] = -half_thickness_ * slope(n[2], n[3]);
}

void Tiles::commit(double, Field& field) noexcept {
  const auto runs = phase_.runs();
  for (std::size_t r = 0; r < runs.size(); ++r)
    if (active_steps_[r])
      std::copy(next_height_.begin() + runs[r].begin, next_height_.begin() + runs[r].end,
                field.height.begin() + runs[r].begin);
}

void Tiles::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : phase_.runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)].level = amplitude_[i] / max_amplitude_;
}

}  // namespace smartsurf::surface
