// The force on the tip of each delta robot, averaged over the tick.
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class TipForceSensor final : public Sensor {
 public:
  TipForceSensor(const Field& field, const scene::SensorSpec& spec)
      : max_force_(static_cast<float>(spec.number("range"))), force_(3 * field.cells(), 0.0F) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    const auto per_second = static_cast<float>(1.0 / input.period_s);
    const std::size_t cells = force_.size() / 3;
    for (std::size_t i = 0; i < input.tip_impulse.size(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis)
        force_[axis * cells + i] =
            std::clamp(input.tip_impulse[i][static_cast<int>(axis)] * per_second, -max_force_, max_force_);
  }
  // x, y and z, mass·u/s², clamped to the sensor's range.
  std::span<const float> values(int /*channel*/) const noexcept override { return force_; }
  void archive(common::StateArchive& a) override { a(force_); }
  bool needs_impulses() const noexcept override { return true; }

 private:
  float max_force_;
  std::vector<float> force_;
};

}  // namespace smartsurf::surface
