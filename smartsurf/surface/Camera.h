// A picture of the table from straight above, the same size for near and far things: colour and height of
// what is topmost.
#pragma once

#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

class Camera final : public Sensor {
 public:
  Camera(const Field&, const scene::SensorSpec&);

  void sense(const Moment&, WorkerPool&) override;
  // A cell has n × n pixels, row by row from its north-west corner; pixel p is components 3p (red), 3p + 1,
  // 3p + 2 of channel 0, and component p of channel 1, the z of what it shows, u.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? colour_ : height_;
  }

 private:
  void paint(const Moment&, std::size_t pixel, int first, int last) noexcept;

  int rows_;
  std::size_t cells_;
  float above_, floor_;
  std::vector<FirstHit> rays_;  // one a pixel
  std::vector<float> colour_, height_;
  std::vector<float> marks_;
};

}  // namespace smartsurf::surface
