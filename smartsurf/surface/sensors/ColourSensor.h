// The colour of what each cell's segment meets first.
#pragma once

#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Of a pin, whatever its surface is made of: the grey of things that have no colour of their own.
inline constexpr scene::Colour kPinColour{};

class ColourSensor final : public Sensor {
 public:
  ColourSensor(const Field&, const scene::SensorSpec&);

  void sense(const SensorInput&, common::ThreadPool&) override;
  // Red, green and blue in [0, 1], as a screen shows them; black where nothing is met.
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
