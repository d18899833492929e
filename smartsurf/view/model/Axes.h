// Where the coordinate axes are drawn: beside the table's south-west corner, on the ground. Internal to the
// room.
#pragma once

#include <algorithm>

#include "smartsurf/view/model/Camera.h"

namespace smartsurf::view {

constexpr double kBoardRim = 0.6;  // of the board under the pins, beyond them, in pitches

struct Axes {
  Eigen::Vector3d origin;
  double length, half_width;  // u
};

inline Axes axes_of(const scene::SurfaceSpec& surface) {
  const Eigen::AlignedBox3d box = Camera::extent(surface);
  const double out = 2.2 * kBoardRim * surface.pitch;
  const double length = 0.08 * std::max(box.sizes().x(), box.sizes().y());
  return {box.min() - Eigen::Vector3d(out, out, 0.0), length, 0.018 * length + 0.02 * surface.pitch};
}

}  // namespace smartsurf::view
