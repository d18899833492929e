// Renders a plane of numbers as a heat map in the terminal.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace shm_protocol::dump {

struct Plane {
  const double* cells;  // rows × columns, row 0 at the top
  std::size_t rows, columns;
};

struct Scale {
  double low = 0, high = 1;
};

// The map, at most `width` characters wide, every line terminated. A larger plane is averaged in square
// blocks. In colour, a character shows two vertically adjacent cells (▀); otherwise one of " .:-=+*#%@" shows
// their mean. NaN and infinities are shown as '?' (in colour: magenta).
std::string heat_map(const Plane&, const Scale&, std::size_t width, bool colour);

// The scale on one line: its colours between its limits.
std::string legend(const Scale&, bool colour);

}  // namespace shm_protocol::dump
