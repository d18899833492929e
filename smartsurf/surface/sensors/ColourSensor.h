// The colour of the closest hit of each cell's ray.
#pragma once

#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Colour of pins: light grey.
inline constexpr scene::Colour kPinColour{0.7F, 0.7F, 0.7F};
// Tag of a ray that hits a pin; objects have positive tags, a miss has 0.
inline constexpr float kPinTag = -1.0F;

class ColourSensor final : public Sensor {
 public:
  ColourSensor(const Field&, const scene::SensorSpec&);

  void sense(const SensorInput&, common::ThreadPool&) override;
  // Red, green and blue (sRGB) in [0, 1], one plane each; black without a hit.
  std::span<const float> values(int /*channel*/) const noexcept override { return planes_; }

 private:
  void write_colours(const SensorInput&, int first, int last) noexcept;

  RayCaster ray_caster_;
  int rows_;
  std::size_t cells_;
  std::vector<float> planes_;
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
