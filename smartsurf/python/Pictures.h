// Pictures of a world as arrays.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "common/image/Image.h"
#include "smartsurf/python/Arrays.h"
#include "smartsurf/simulation/Environment.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/output/OffscreenView.h"

namespace smartsurf::python {

using simulation::Environment;

// The view of a picture: a preset or "X,Y,Z:X,Y,Z", where the camera is and its target, and the object that
// it follows, or −1.
using CameraChoice = std::pair<std::string, int>;

view::CameraView camera_view(const std::string& text);

// view: kept for the next picture; made where it is null.
common::Image render(const Environment& environment, std::unique_ptr<view::OffscreenView>& view, int width,
                     int height, const CameraChoice& camera, bool fast);

// (depth, segmentation)
py::tuple render_range(const Environment& environment, int width, int height, const CameraChoice& camera);

py::array_t<std::uint8_t> to_array(const common::Image& image);

}  // namespace smartsurf::python
