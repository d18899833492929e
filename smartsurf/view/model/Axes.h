// The position and size of the drawn coordinate axes, on the ground at the table's south-west corner.
// Internal to smartsurf/view.
#pragma once

#include <algorithm>

#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {

constexpr double kBoardMargin = 0.6;  // how far the board extends beyond the pins, in pitches

struct Axes {
  Eigen::Vector3d origin;
  double length, half_width;  // u
};

inline Axes make_axes(const scene::SurfaceSpec& surface) {
  const Eigen::AlignedBox3d box = surface_bounding_box(surface);
  const double offset = 2.2 * kBoardMargin * surface.pitch;
  const double length = 0.08 * std::max(box.sizes().x(), box.sizes().y());
  return {box.min() - Eigen::Vector3d(offset, offset, 0.0), length, 0.018 * length + 0.02 * surface.pitch};
}

}  // namespace smartsurf::view
