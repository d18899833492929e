// Depth and segmentation of a picture, by ray casting: without OpenGL, with the rays of the picture's camera.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {

// height × width, row 0 at the top, at the centres of the pixels.
struct RangeImage {
  std::vector<float> depth;                // along Camera::forward(), u; infinite where nothing is
  std::vector<std::int32_t> segmentation;  // id of the object; −1: nothing; −2 − k: cell k, row-major
};

// Shapes are exact; as for pick(), the gaps of a regular grid belong to the cells, and a cell is a column.
// Throws scene::InputError if width or height is not 1 to 8192 pixels.
RangeImage capture_range(const scene::SurfaceSpec&, const FrameInput&, const Camera&, int width, int height);

}  // namespace smartsurf::view
