// The normal force on each cell, averaged over the tick.
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class PressureSensor final : public Sensor {
 public:
  PressureSensor(const Field& field, const scene::SensorSpec& spec)
      : max_force_(static_cast<float>(spec.number("range"))), force_(field.cells(), 0.0F) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    const auto per_second = static_cast<float>(1.0 / input.period_s);
    const std::size_t cells = std::min(force_.size(), input.impulse.size());
    for (std::size_t i = 0; i < cells; ++i) force_[i] = std::min(input.impulse[i] * per_second, max_force_);
  }
  // mass·u/s², clamped to the sensor's range.
  std::span<const float> values(int /*channel*/) const noexcept override { return force_; }
  void archive(common::StateArchive& a) override { a(force_); }
  bool needs_impulses() const noexcept override { return true; }

 private:
  float max_force_;
  std::vector<float> force_;
};

}  // namespace smartsurf::surface
