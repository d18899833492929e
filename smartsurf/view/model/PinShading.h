// Per-pin data for the GPU: height, colour and sky visibility. The surface is a height field, so occlusion by
// neighbours and by objects overhead is computed once per pin on the CPU instead of once per pixel.
//
// No OpenGL. Allocates in the first frame only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/DrawOptions.h"

namespace smartsurf::view {

// Three groups of 16 bytes, as the shader fetches them.
struct PinInstance {
  std::array<float, 2> position;       // centre, u
  std::array<float, 2> rotation;       // cosine and sine of the turn about z
  std::array<float, 4> neighbour;      // z of the tops of the pins to the west, east, south, north, u
  std::array<std::uint8_t, 4> colour;  // linear light, 255 = 1; [3]: 255 in the outermost ring, else 0
  std::array<std::uint8_t, 4>
      corner_sky_visibility;  // share of the sky that the top's corners SW, SE, NW, NE see; 255 = all
  float height;               // z of the top, u
  std::uint32_t unused = 0;
};

class PinShading {
 public:
  explicit PinShading(const scene::SurfaceSpec& surface);

  // One record a pin (none for a cell that is not there), in drawing order: rows from the south to the north
  // unless north_first, in each row from the west to the east unless east_first. Valid until the next call.
  // recess: how far below its top each cell is drawn, u; rows × columns, or empty for 0.
  std::span<const PinInstance> update(const scene::Snapshot& snapshot,
                                      const std::vector<scene::ObjectSpec>& catalogue,
                                      const DrawOptions& options, bool north_first, bool east_first,
                                      std::span<const float> recess = {});

  // Mean height of the pins around an object that reaches that far from its centre; the table's base beside
  // it.
  float mean_height_around(const scene::Snapshot& snapshot, float x, float y, float radius) const;

 private:
  using CornerValues = std::array<float, 4>;
  using Rgba8 = std::array<std::uint8_t, 4>;
  struct ColourTables {
    std::array<Rgba8, 256> height;  // from the lowest to the highest
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
  float base_;  // z of the table, u
  ColourTables colour_tables_;
  std::vector<CornerValues> sky_visibility_;  // rows × columns, row-major, row 0 north
  std::vector<PinInstance> pins_;
};

// z of the ground on which the pins stand, u.
double ground_height(const scene::SurfaceSpec& surface);

}  // namespace smartsurf::view
