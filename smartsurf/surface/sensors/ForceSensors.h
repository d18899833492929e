// Forces, averaged over the tick and clamped to the sensor's range, mass·u/s².
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class ForceSensor : public Sensor {
 public:
  std::span<const float> values(int /*channel*/) const noexcept final { return force_; }
  void archive(common::StateArchive& a) final { a(force_); }
  bool needs_impulses() const noexcept final { return true; }

 protected:
  ForceSensor(const scene::SensorSpec& spec, std::size_t count)
      : max_force_(static_cast<float>(spec.number("range"))), force_(count, 0.0F) {}

  float max_force_;
  std::vector<float> force_;
};

// The normal force on each cell.
class PressureSensor final : public ForceSensor {
 public:
  PressureSensor(const Field& field, const scene::SensorSpec& spec) : ForceSensor(spec, field.cells()) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    const auto per_second = static_cast<float>(1.0 / input.period_s);
    const std::size_t cells = std::min(force_.size(), input.impulse.size());
    for (std::size_t i = 0; i < cells; ++i) force_[i] = std::min(input.impulse[i] * per_second, max_force_);
  }
};

// The force on the tip of each delta robot: x, y and z.
class TipForceSensor final : public ForceSensor {
 public:
  TipForceSensor(const Field& field, const scene::SensorSpec& spec) : ForceSensor(spec, 3 * field.cells()) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    const auto per_second = static_cast<float>(1.0 / input.period_s);
    const std::size_t cells = force_.size() / 3;
    for (std::size_t i = 0; i < input.tip_impulse.size(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis)
        force_[axis * cells + i] =
            std::clamp(input.tip_impulse[i][static_cast<int>(axis)] * per_second, -max_force_, max_force_);
  }
};

}  // namespace smartsurf::surface
