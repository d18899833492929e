// One grey frame of a video or camera.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Plane.h"

namespace apron::run {

struct GreyFrame {
  std::uint32_t width = 0, height = 0;  // neither 0
  std::vector<std::uint8_t> pixels;     // grey, row by row from the top
};

// The largest part in the frame's middle that has the plane's proportions fills the plane: each cell is the
// mean of the pixels that it covers, or the nearest one where the plane has more cells.
void resample_center_crop(const GreyFrame& frame, const vm::Plane& to);

}  // namespace apron::run
