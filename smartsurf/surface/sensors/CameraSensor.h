// A picture of the table from straight above, the same size for near and far things: colour and height of
// what is topmost.
#pragma once

#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class CameraSensor final : public Sensor {
 public:
  CameraSensor(const Field&, const scene::SensorSpec&);

  void sense(const SensorInput&, common::ThreadPool&) override;
  // A cell has n × n pixels, row by row from its north-west corner; pixel p is components 3p (red), 3p + 1,
  // 3p + 2 of channel 0, and component p of channel 1, the z of what it shows, u.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? colour_ : height_;
  }

 private:
  void write_pixels(const SensorInput&, std::size_t pixel, int first, int last) noexcept;

  int rows_;
  std::size_t cells_;
  float camera_height_, floor_height_;
  std::vector<RayCaster> ray_casters_;  // one a pixel
  std::vector<float> colour_, height_;
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
