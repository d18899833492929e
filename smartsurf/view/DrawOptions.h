// What a picture shows besides the bare scene.
#pragma once

#include <span>

namespace smartsurf::view {

enum class Style {
  kSolid,      // lit and shaded
  kWireframe,  // objects as wires, so that the cells under them can be seen
};

struct DrawOptions {
  Style style = Style::kSolid;

  // Colours the pins by one channel instead of by height: rows × columns values, row-major, row 0 north, in
  // the channel's unit. low takes the palette's dark end and high its bright one; for distances, where near
  // should be bright, low may be the larger. Empty: none. Must outlive the call it is given to.
  std::span<const float> cell_values;
  float low = 0.0f, high = 1.0f;

  bool grid = true;  // the ground's grid
  bool axes = true;  // x red, y green, z blue, at the south-west corner
};

}  // namespace smartsurf::view
