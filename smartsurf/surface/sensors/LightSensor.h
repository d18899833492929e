// The visible fraction of a distant light at each cell.
#pragma once

#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class LightSensor final : public Sensor {
 public:
  LightSensor(const Field&, const scene::SensorSpec&);

  void sense(const SensorInput&, common::ThreadPool&) override;
  // Fraction of the light's disc visible from the cell: 1 unobstructed, 0 in full shadow.
  std::span<const float> values(int /*channel*/) const noexcept override { return visible_fraction_; }

 private:
  int rows_;
  std::vector<RayCaster> ray_casters_;  // one per sample point of the light
  std::vector<float> visible_fraction_;
  std::vector<float> body_tags_;  // 1 for every body
};

}  // namespace smartsurf::surface
