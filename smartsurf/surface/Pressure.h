// The normal force on each cell, averaged over the tick.
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

class Pressure final : public Sensor {
 public:
  Pressure(const Field& field, const scene::SensorSpec& spec)
      : greatest_(static_cast<float>(spec.number("range"))),
        force_(static_cast<std::size_t>(field.cells()), 0.0F) {}

  void sense(const Moment& moment, WorkerPool&) override {
    const auto per_second = static_cast<float>(1.0 / moment.period_s);
    const std::size_t cells = std::min(force_.size(), moment.impulse.size());
    for (std::size_t i = 0; i < cells; ++i) force_[i] = std::min(moment.impulse[i] * per_second, greatest_);
  }
  // mass·u/s²
  std::span<const float> values(int /*channel*/) const noexcept override { return force_; }
  bool feels() const noexcept override { return true; }

 private:
  float greatest_;
  std::vector<float> force_;
};

}  // namespace smartsurf::surface
