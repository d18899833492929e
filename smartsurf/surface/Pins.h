// Pins: each follows its target height within limits of speed and acceleration, and yields to a load that
// it cannot lift.
#pragma once

#include <cstdint>
#include <optional>

#include "smartsurf/surface/Actuator.h"

namespace smartsurf::surface {

class Approach;

class Pins final : public Actuator {
 public:
  explicit Pins(const Place&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  bool yields() const noexcept override { return force_limit_.has_value(); }

 private:
  // Calls work(run) for every run, or for those that move; shared where it is worth it.
  template <class Work>
  void for_runs(double cost_ns, const Work& work) const;
  template <class Work>
  void for_moving_runs(double cost_ns, const Work& work) const;
  void plan_run(std::size_t run, const Approach&, float dt_s, Field&) noexcept;
  float plan_loaded(std::size_t cell, const Approach&, float dt_s, Field&) noexcept;
  float lower_stop(std::size_t cell) const { return base_[cell] + lowest_; }

  std::vector<Run> runs_;
  WorkerPool* pool_;
  std::size_t pins_;
  float speed_limit_, acceleration_limit_;
  float lowest_;  // of the range, over the base
  std::optional<float> force_limit_;
  std::vector<float> base_, target_;  // rows × columns; target: z of the top, base included
  // Of pins with a force limit, rows × columns, empty without: the speed that each was to have, u/s; how long
  // it does not try to leave the lower stop, s.
  std::vector<float> planned_, wait_;
  // One a run, so that a run whose pins all rest on their targets costs nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> run_height_, run_speed_;  // the run's highest top and greatest |speed|
};

}  // namespace smartsurf::surface
