// Vibrating cells under a flexible skin: z = amplitude·sin(2π·frequency·t − phase), coupled to their four
// neighbours by the skin.
//
// With s the coupling, the skin's height is h = (1 − s)·z + s·(mean of the neighbours' z). The upper face of
// a bending skin of thickness d is displaced by −(d/2)·∇h (Kirchhoff plate), so its surface velocity is
// −(d/2)·∇(dh/dt). The crests of a travelling wave, which carry the objects, therefore move against the wave.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

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

class Tiles final : public Actuator {
 public:
  explicit Tiles(const ActuatorContext& context)
      : columns_(context.field.columns),
        skin_coupling_(context.number("skin")),
        half_thickness_(static_cast<float>(context.spec.number("thickness") / 2.0)),
        pitch_(context.field.pitch),
        max_amplitude_(context.number("max_amplitude")),
        frequency_hz_(context.spec.number("frequency")),
        phase_(context, 0.0F, RateLimitedLag::kNoRateLimit, context.spec.number("lag")),
        amplitude_(context, 0.0F, RateLimitedLag::kNoRateLimit, context.spec.number("lag")),
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
          if (!inside || run_of[other] < 0) return i;
          const std::size_t run = run_of[other];
          if (std::ranges::find(coupled_runs_[r], run) == coupled_runs_[r].end())
            coupled_runs_[r].push_back(run);
          return other;
        };
        neighbour_[i] = {neighbour_or_self(column > 0, i - 1),
                         neighbour_or_self(column + 1 < columns_, i + 1),
                         neighbour_or_self(i + columns_ < cells, i + columns_),
                         neighbour_or_self(i >= columns_, i - columns_)};
      }
    }
  }

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    (channel == 0 ? phase_ : amplitude_).set_targets(targets);
  }

  void snap_to_targets(Field& field) noexcept override {
    phase_.snap_to_targets();
    amplitude_.snap_to_targets();
    update_excitation(0.0);
    for (const CellRun& run : phase_.runs())
      for (int i = run.begin; i < run.end; ++i) {
        field.height[i] = next_height_[i] = base_[i] + skin_height(i);
      }
    std::ranges::fill(active_steps_, kActiveSteps);
  }

  void plan(double dt_s, Field& field) noexcept override {
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
        next_height_[i] = base_[i] + skin_height(i);
        field.speed[i] = (next_height_[i] - field.height[i]) * inverse_dt;
        field.max_height = std::max({field.max_height, next_height_[i], field.height[i]});
        field.max_speed = std::max(field.max_speed, std::abs(field.speed[i]));
      }
    for (std::size_t r = 0; r < runs.size(); ++r)
      for (int i = runs[r].begin; active_steps_[r] && i < runs[r].end; ++i) update_surface_velocity(i, field);
  }

  void commit(double, Field& field) noexcept override {
    const auto runs = phase_.runs();
    for (std::size_t r = 0; r < runs.size(); ++r)
      if (active_steps_[r])
        std::copy(next_height_.begin() + runs[r].begin, next_height_.begin() + runs[r].end,
                  field.height.begin() + runs[r].begin);
  }

  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : phase_.runs())
      for (int i = run.begin; i < run.end; ++i) motion[i].level = amplitude_[i] / max_amplitude_;
  }

  void archive(common::StateArchive& a) override {
    a(time_s_, phase_, amplitude_, excitation_, next_height_, active_steps_);
  }

 private:
  bool is_vibrating(std::size_t run) const noexcept {
    for (int i = phase_.runs()[run].begin; i < phase_.runs()[run].end; ++i)
      if (amplitude_[i] != 0.0F) return true;
    return false;
  }

  void update_excitation(double time_s) noexcept {
    const auto omega_t = static_cast<float>(std::remainder(kTwoPi * frequency_hz_ * time_s, kTwoPi));
    for (const CellRun& run : phase_.runs())
      for (int i = run.begin; i < run.end; ++i) {
        if (amplitude_[i] == 0.0F && excitation_[i] == 0.0F) continue;
        excitation_[i] = amplitude_[i] * std::sin(omega_t - phase_[i]);
      }
  }

  float skin_height(int cell) const noexcept {
    const auto& n = neighbour_[cell];
    float sum = 0.0F;
    for (const int other : n) sum += excitation_[other];
    return (1.0F - skin_coupling_) * excitation_[cell] + skin_coupling_ * 0.25F * sum;
  }

  // Reads the speeds of the neighbours.
  void update_surface_velocity(int i, Field& field) noexcept {
    const auto& n = neighbour_[i];
    auto slope = [&](int low, int high) {
      const int steps = static_cast<int>(low != i) + static_cast<int>(high != i);
      if (steps == 0) return 0.0F;
      return (field.speed[high] - field.speed[low]) / (static_cast<float>(steps) * pitch_);
    };
    field.surface_velocity_x[i] = -half_thickness_ * slope(n[0], n[1]);
    field.surface_velocity_y[i] = -half_thickness_ * slope(n[2], n[3]);
  }

  int columns_;
  float skin_coupling_, half_thickness_, pitch_, max_amplitude_;
  double frequency_hz_, time_s_ = 0.0;
  RateLimitedLag phase_, amplitude_;
  // rows × columns, u; excitation_ is the z of a cell before coupling
  std::vector<float> base_, excitation_, next_height_;
  // rows × columns: west, east, south, north neighbour; the cell itself at the edge of the skin
  std::vector<std::array<int, 4>> neighbour_;
  std::vector<std::uint8_t> active_steps_;  // one per run; not 0 while the run or a coupled run moves
  std::vector<std::vector<std::size_t>> coupled_runs_;  // by run: the run itself and its neighbours
};

}  // namespace

std::unique_ptr<Actuator> make_tiles(const ActuatorContext& context) {
  return std::make_unique<Tiles>(context);
}

}  // namespace smartsurf::surface
