// An encoder at each cell: the height of its top.
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class PinHeightSensor final : public Sensor {
 public:
  PinHeightSensor(const Field& field, const scene::SensorSpec&) : height_(field.cells(), 0.0F) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    std::ranges::transform(input.snapshot.height, height_.begin(),
                           [](float z) { return z == kNoCellHeight ? 0.0F : z; });
  }
  std::span<const float> values(int /*channel*/) const noexcept override { return height_; }

 private:
  std::vector<float> height_;  // u; 0: no cell
};

}  // namespace smartsurf::surface
