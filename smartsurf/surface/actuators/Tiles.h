// Vibrating cells under a flexible skin: z = amplitude·sin(2π·frequency·t − phase), coupled to their four
// neighbours by the skin.
//
// With s the coupling, the skin's height is h = (1 − s)·z + s·(mean of the neighbours' z). The upper face of
// a bending skin of thickness d is displaced by −(d/2)·∇h (Kirchhoff plate), so its surface velocity is
// −(d/2)·∇(dh/dt). The crests of a travelling wave, which carry the objects, therefore move against the wave.
#pragma once

#include <array>

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class Tiles final : public Actuator {
 public:
  explicit Tiles(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

  void archive(common::StateArchive& a) override {
    a(time_s_, phase_, amplitude_, excitation_, next_height_, active_steps_);
  }

 private:
  bool is_vibrating(std::size_t run) const noexcept;
  void update_excitation(double time_s) noexcept;
  float skin_height(int cell) const noexcept;  // u above the base
  // Reads the speeds of the neighbours.
  void update_surface_velocity(int cell, Field&) noexcept;

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

}  // namespace smartsurf::surface
