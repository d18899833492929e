// Cells that vibrate under a flexible skin: z = amplitude·sin(2π·frequency·t − phase), each one's motion
// shared with its neighbours through the skin, whose bending moves its upper side to and fro.
//
// With s the skin's share: h = (1 − s)·z + s·(mean of the neighbours' z). The upper side of a skin of
// thickness d that bends moves by −(d/2)·∇h (Kirchhoff's plate), so what lies on it is dragged at
// −(d/2)·∇(dh/dt): on a travelling wave the crests, where it lies, go against the wave.
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

 private:
  bool is_vibrating(std::size_t run) const noexcept;
  void update_excitation(double time_s) noexcept;           // own_ at that time
  float skin_height(int cell) const noexcept;               // the height of the skin over the base
  void update_surface_velocity(int cell, Field&) noexcept;  // drag from the speeds of the neighbours

  int columns_;
  float skin_coupling_, half_thickness_, pitch_, max_amplitude_;
  double frequency_hz_, time_s_ = 0.0;
  RateLimitedLag phase_, amplitude_;
  // rows × columns
  std::vector<float> base_, excitation_, next_height_;
  std::vector<std::array<int, 4>>
      neighbour_;                           // west, east, south, north; the cell itself where the skin ends
  std::vector<std::uint8_t> active_steps_;  // one a run: not 0 while it or a neighbour of it moves
  std::vector<std::vector<std::size_t>> coupled_runs_;  // runs that share the skin with each
};

}  // namespace smartsurf::surface
