// An orthographic image of the surface from above: colour and height of the topmost object or pin at each
// pixel.
#pragma once

#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class CameraSensor final : public Sensor {
 public:
  CameraSensor(const Field&, const scene::SensorSpec&);

  void sense(const SensorInput&, common::ThreadPool&) override;
  // A cell has n × n pixels in row-major order from its north-west corner. Channel 0: red, green and blue of
  // pixel p in [0, 1] as components 3p, 3p + 1 and 3p + 2. Channel 1: z of pixel p, u, as component p.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? colour_ : height_;
  }

 private:
  void write_pixels(const SensorInput&, std::size_t pixel, int first, int last) noexcept;

  int rows_;
  std::size_t cells_;
  float camera_height_, floor_height_;
  std::vector<RayCaster> ray_casters_;  // one per pixel
  std::vector<float> colour_, height_;
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
