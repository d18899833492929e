// What a picture shows in addition to the scene.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {

enum class FillMode {
  kSolid,      // lit and shaded
  kWireframe,  // objects as wires, so that the cells under them can be seen
};

// A straight line of the same width in pixels wherever it is.
struct Line {
  std::array<float, 3> from, to;       // u
  std::array<std::uint8_t, 4> colour;  // as a screen shows it, and how opaque; 255 = 1
};

// The heat map as its legend explains it.
struct ColourScale {
  std::string channel, unit;
  Palette palette = Palette::kViridis;
  float low = 0.0F, high = 1.0F;  // at the palette's dark and bright end
};

struct DrawOptions {
  FillMode fill_mode = FillMode::kSolid;

  // Colours the pins by one channel instead of by height: rows × columns values, row-major, row 0 north, in
  // the channel's unit. low takes the palette's dark end and high its bright one; for distances, where near
  // should be bright, low may be the larger. Empty: none. Must outlive the call it is given to.
  std::span<const float> cell_values;
  float low = 0.0f, high = 1.0f;
  Palette palette = Palette::kViridis;

  std::span<const Line> lines;  // trails, forces, marks; must outlive the call
  float line_width = 2.0f;      // pixels of the picture

  const ColourScale* legend = nullptr;  // drawn in the lower right corner of pictures; must outlive the call

  bool grid = true;  // the ground's grid
  bool axes = true;  // x red, y green, z blue, at the south-west corner
};

}  // namespace smartsurf::view
