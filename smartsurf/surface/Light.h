// How much of a light far away in one direction arrives at each cell.
#pragma once

#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

class Light final : public Sensor {
 public:
  Light(const Field&, const scene::SensorSpec&);

  void sense(const Moment&, WorkerPool&) override;
  // The share of the light's face that the cell sees: 1 in the open, 0 in full shadow.
  std::span<const float> values(int /*channel*/) const noexcept override { return share_; }

 private:
  int rows_;
  std::vector<FirstHit> rays_;  // one to each point of the light that is looked for
  std::vector<float> share_;
  std::vector<float> shade_;  // 1 for every body
};

}  // namespace smartsurf::surface
