// Options of one rendered image: fill mode, cell colours, overlay lines and legend.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {

enum class FillMode {
  kSolid,      // lit and shaded
  kWireframe,  // objects as wireframes, which leaves the cells under them visible
};

// The ground, the background and the light.
enum class Stage { kLight, kDark };
inline constexpr std::array<const char*, 2> kStageNames = {"light", "dark"};

// How much work a frame may be. kStill: smooth edges, soft shadows, ambient occlusion; about a second for a
// picture on a software renderer. kVideo: about a tenth of that. kFast: some milliseconds for a small image.
// kFinal: path-traced, some seconds for a picture. These four have the order of the flag --quality. kSmooth:
// as kFast with smooth edges, in twice the time.
enum class Detail { kStill, kVideo, kFast, kFinal, kSmooth };

// A straight line of constant width in pixels.
struct Line {
  std::array<float, 3> from, to;       // u
  std::array<std::uint8_t, 4> colour;  // sRGB and alpha, 255 = 1
};

// The colour scale of a heat map, as its legend shows it.
struct ColourScale {
  std::string channel, unit;
  Palette palette = Palette::kViridis;
  float low = 0.0F, high = 1.0F;  // values at the palette's dark and bright end
  bool has_gaps = false;          // cells without a value are grey: a distance sensor that sees nothing
};

inline constexpr int kDefaultSamples = 32;

struct DrawOptions {
  FillMode fill_mode = FillMode::kSolid;
  Stage stage = Stage::kLight;

  // Values that colour the pins: rows × columns, row-major, row 0 north, in the channel's unit. `low` maps to
  // the palette's dark end, `high` to its bright end; low > high reverses the palette. Empty: pins are
  // coloured by height. Must outlive the call.
  std::span<const float> cell_values;
  float low = 0.0f, high = 1.0f;
  Palette palette = Palette::kViridis;

  std::span<const Line> lines;  // trails, forces, selection; must outlive the call
  float line_width = 2.0f;      // pixels

  // Drawn in the lower right corner of off-screen images. Must outlive the call.
  const ColourScale* legend = nullptr;

  // Path-traced pictures: the lens diameter, u, focused on the camera's target (0: everything is sharp), and
  // the paths per pixel.
  double aperture = 0.0;
  int samples = kDefaultSamples;

  bool grid = true;  // on the ground
  bool axes = true;  // x red, y green, z blue, at the south-west corner
};

}  // namespace smartsurf::view
