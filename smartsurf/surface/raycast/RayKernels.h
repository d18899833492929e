// The inner loops of a sweep of segments over bodies. Internal to the room: FirstHit prepares what they need.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "smartsurf/surface/raycast/RayBodies.h"

namespace smartsurf::surface {

// A distance and a mark are one entry a cell, and a block is kBlock cells of a row.
inline constexpr int kBlock = 16;

// Where the cells of a free layout start their segments, sorted into strips of equal height from the south,
// by x within a strip.
struct StripLayout {
  float south = 0.0F, height = 1.0F;           // of the first strip; of each
  std::vector<int> first;                      // strips + 1: the strip's cells are [first[s], first[s + 1])
  std::vector<float> x, y, dx, dy;             // start and direction of each segment; dz is the same for all
  std::vector<int> cell;                       // the cell's index in the field
  float max_abs_dx = 0.0F, max_abs_dy = 0.0F;  // of the widest cell's |dx|, |dy|
};

struct RayCastJob {
  std::span<const RayBody> bodies;
  std::span<const float> tags;  // one a body
  std::span<const RayBodies::Cluster> clusters;
  // All segments start at z = height + origin.z and run along `direction`, unit, for `range`.
  Eigen::Vector3f origin, direction;
  float range = 0.0F;
  // Of all starts' z; infinite where nobody knows.
  float min_start_z = -std::numeric_limits<float>::infinity(),
        max_start_z = std::numeric_limits<float>::infinity();
  const float* height = nullptr;  // one a cell; null: 0 for all
  float* distance = nullptr;
  float* tag = nullptr;
  std::uint8_t* dirty_blocks = nullptr;  // one a block; null: nobody asks

  // A rectangular grid of these cells, unless there are strips.
  int rows = 0, columns = 0, blocks_per_row = 0;  // blocks in a row
  float pitch = 1.0F;
  const float* x = nullptr;  // of the starts, one a column
  const StripLayout* strips = nullptr;
};

// Meets the segments that start in these rows (of the grid from the north, or strips) with all bodies. Before
// a body that may concern rows of a grid which none did before, prepare(first, last) makes those [first,
// last) ready: close to their use, for what it writes to be still at hand. In the end all are.
using PrepareRows = std::function<void(int first, int last)>;
void cast_rows(const RayCastJob&, int begin, int end, const PrepareRows& prepare) noexcept;

// A pin is a bottomless column; touching its top is not meeting it, for a segment may begin there. In a
// rectangular grid the pin that lies a given number of rows and columns away is passed at the same distances
// from every cell.
struct PinStep {
  int row_offset, column_offset;
  float t_enter, t_exit;  // where a segment is above that pin, enter < leave
};
struct PinRowRays {
  const float* start_height;  // of the cells where the segments start, `count` of them; null: 0 for all
  float origin_z;             // their starts' z above that
  const float* pin_height;    // height of the pins they pass over
  float* distance;
  float* tag;
  int count;
};
// Keeps what is nearer than what was met before; whether any segment met its pin.
bool cast_to_pins(const PinRowRays&, const PinStep&, float dz, float range, float tag) noexcept;

}  // namespace smartsurf::surface
