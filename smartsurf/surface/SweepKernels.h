// The inner loops of a sweep of segments over bodies. Internal to the room: FirstHit prepares what they need.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "smartsurf/surface/SensedBodies.h"

namespace smartsurf::surface {

// A distance and a mark are one entry a cell, and a block is kBlock cells of a row.
inline constexpr int kBlock = 16;

// Where the cells of a free layout start their segments, sorted into strips of equal height from the south,
// by x within a strip.
struct StripLayout {
  float south = 0.0F, height = 1.0F;         // of the first strip; of each
  std::vector<int> first;                    // strips + 1: the strip's cells are [first[s], first[s + 1])
  std::vector<float> x, y, dx, dy;           // start and direction of each segment; dz is the same for all
  std::vector<int> cell;                     // the cell's index in the field
  float longest_x = 0.0F, longest_y = 0.0F;  // of the widest cell's |dx|, |dy|
};

struct SweepJob {
  std::span<const SensedBody> bodies;
  std::span<const float> marks;  // one a body
  std::span<const SensedBodies::Bundle> bundles;
  // All segments start at z = height + origin.z and run along `direction`, unit, for `range`.
  Eigen::Vector3f origin, direction;
  float range = 0.0F;
  // Of all starts' z; infinite where nobody knows.
  float lowest = -std::numeric_limits<float>::infinity(), highest = std::numeric_limits<float>::infinity();
  const float* height = nullptr;  // one a cell; null: 0 for all
  float* distance = nullptr;
  float* mark = nullptr;
  std::uint8_t* touched = nullptr;  // one a block; null: nobody asks

  // A rectangular grid of these cells, unless there are strips.
  int rows = 0, columns = 0, blocks = 0;  // blocks in a row
  float pitch = 1.0F;
  const float* x = nullptr;  // of the starts, one a column
  const StripLayout* strips = nullptr;
};

// Meets the segments that start in these rows (of the grid from the north, or strips) with all bodies. Before
// a body that may concern rows of a grid which none did before, prepare(first, last) makes those [first,
// last) ready: close to their use, for what it writes to be still at hand. In the end all are.
using PrepareRows = std::function<void(int first, int last)>;
void sweep_rows(const SweepJob&, int begin, int end, const PrepareRows& prepare) noexcept;

// A pin is a bottomless column; touching its top is not meeting it, for a segment may begin there. In a
// rectangular grid the pin that lies a given number of rows and columns away is passed at the same distances
// from every cell.
struct PinStep {
  int row_offset, column_offset;
  float enter, leave;  // where a segment is above that pin, enter < leave
};
struct PinRow {
  const float* height;  // of the cells where the segments start, `count` of them; null: 0 for all
  float lift;           // their starts' z above that
  const float* pin;     // height of the pins they pass over
  float* distance;
  float* mark;
  int count;
};
// Keeps what is nearer than what was met before; whether any segment met its pin.
bool meet_pins(const PinRow&, const PinStep&, float rise, float range, float mark) noexcept;

}  // namespace smartsurf::surface
