// One grey frame of a video or camera.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Plane.h"

namespace apron::run {

struct GreyFrame {
  std::uint32_t width = 0, height = 0;  // pixels; not 0 in a valid frame
  std::vector<std::uint8_t> pixels;     // row-major from the top
};

// Resamples the largest centred part of the frame that has the plane's aspect ratio. Each cell is the mean of
// the pixels that it covers, or a single pixel where the plane has more cells than the frame has pixels.
void resample_center_crop(const GreyFrame& frame, const vm::Plane& to);

}  // namespace apron::run
