// Computes the per-pin data of a frame: height, colour and sky visibility. The surface is a height field, so
// ambient occlusion by neighbours and by objects above is computed once per pin instead of once per fragment.
//
// No OpenGL. Allocates only in the constructor.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {

// sRGB. A pin's colour is mixed by the square root of its height's share of the range.
inline constexpr Rgb kLowestPinColour{0.36F, 0.42F, 0.50F}, kHighestPinColour{0.80F, 0.805F, 0.81F},
    kBorderColour{0.31F, 0.34F, 0.39F};
// The drawn share of the height of a wall that faces the camera.
inline constexpr double kLoweredWall = 0.3;

// The prisms with which a cell is drawn, at turns of 60°: three that overlap, and together are a hexagon, or
// one.
int prisms_per_cell(const scene::SurfaceSpec&);
// Half edges of their tops, u.
std::array<float, 2> prism_half_edges(const scene::SurfaceSpec&);

// Three texels of 16 bytes, as kPinVertex fetches them.
struct PinInstance {
  std::array<float, 2> position;       // centre, u
  std::array<float, 2> rotation;       // cosine and sine of the rotation about z
  std::array<float, 4> neighbour;      // z of the tops of the pins to the west, east, south, north, u
  std::array<std::uint8_t, 4> colour;  // linear light, 255 = 1; [3]: 255 in the outermost ring, else 0
  // Visible share of the sky at the top's corners SW, SE, NW, NE; 255 = all.
  std::array<std::uint8_t, 4> corner_sky_visibility;
  float height;  // z of the top, u
  std::uint32_t unused = 0;
};

// The sides of the border that face the camera, and would hide what lies behind them.
struct NearWalls {
  bool west = false, east = false, south = false, north = false;
};

class PinShading {
 public:
  explicit PinShading(const scene::SurfaceSpec& surface);

  // Returns one record per prism of a pin, none for empty cells, in drawing order: rows from south to north
  // (north_first: reversed), within a row from west to east (east_first: reversed). Valid until the next
  // call.
  //
  // catalogue: every object ever created, index = object id. recess: how far below its top each cell is
  // drawn, u; rows × columns, row-major, or empty for 0. near_walls are drawn lower than they are.
  std::span<const PinInstance> update(const scene::Snapshot& snapshot,
                                      const std::vector<scene::ObjectSpec>& catalogue,
                                      const DrawOptions& options, bool north_first, bool east_first,
                                      std::span<const float> recess = {}, const NearWalls& near_walls = {});

  // Mean height, u, of the pins on a circle of `radius` around (x, y). Points beside the table count as the
  // ground.
  float mean_height_around(const scene::Snapshot& snapshot, float x, float y, float radius) const;

 private:
  using CornerValues = std::array<float, 4>;
  using Rgba8 = std::array<std::uint8_t, 4>;
  struct ColourTables {
    std::array<Rgba8, 256> height;  // from the lowest to the highest position
    std::array<std::array<Rgba8, 256>, common::kPaletteCount> channel;
    Rgba8 border, no_value;
  };
  static ColourTables make_colour_tables();

  float height_at(const scene::Snapshot& snapshot, int row, int column) const;
  CornerValues sky_visibility(const scene::Snapshot& snapshot, int row, int column) const;
  void apply_object_occlusion(const scene::Snapshot& snapshot, const std::array<float, 3>& centre,
                              float radius);
  Rgba8 pin_colour(const scene::Snapshot& snapshot, const DrawOptions& options, int row, int column) const;

  scene::SurfaceSpec surface_;
  float base_;         // z of the ground, u
  float wall_height_;  // drawn z of a wall that faces the camera, u
  ColourTables colour_tables_;
  std::vector<CornerValues> sky_visibility_;  // rows × columns, row-major, row 0 north
  int prisms_;                                // per cell
  std::vector<PinInstance> pins_;
};

}  // namespace smartsurf::view
