// The colour of what each cell's segment meets first.
#pragma once

#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

// Of a pin, whatever its surface is made of: the grey of things that have no colour of their own.
inline constexpr scene::Colour kPinColour{};

class Colour final : public Sensor {
 public:
  Colour(const Field&, const scene::SensorSpec&);

  void sense(const Moment&, WorkerPool&) override;
  // Red, green and blue in [0, 1], as a screen shows them; black where nothing is met.
  std::span<const float> values(int /*channel*/) const noexcept override { return planes_; }

 private:
  void paint(const Moment&, int first, int last) noexcept;

  FirstHit first_;
  int rows_;
  std::size_t cells_;
  std::vector<float> planes_;
  std::vector<float> marks_;
};

}  // namespace smartsurf::surface
