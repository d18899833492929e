// The positions of the joints by which a delta robot holds its tip.
#pragma once

#include <algorithm>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class JointPositionSensor final : public Sensor {
 public:
  JointPositionSensor(const Field& field, const scene::SensorSpec& spec)
      : range_(static_cast<float>(spec.number("range"))),
        position_(scene::kMaxJoints * field.cells(), 0.0F) {}

  void sense(const SensorInput& input, common::ThreadPool&) override {
    const std::vector<float>& truth = input.snapshot.joint_position;
    for (std::size_t i = 0; i < truth.size(); ++i) position_[i] = std::clamp(truth[i], -range_, range_);
  }
  std::span<const float> values(int /*channel*/) const noexcept override { return position_; }

 private:
  float range_;
  std::vector<float> position_;  // u, clamped to the sensor's range
};

}  // namespace smartsurf::surface
