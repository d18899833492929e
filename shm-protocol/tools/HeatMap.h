// A plane of numbers as a heat map in the terminal.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace shm_protocol::dump {

struct Plane {
  const double* cells;  // rows × columns, row 0 on top
  std::size_t rows, columns;
};

struct Scale {
  double low = 0, high = 1;
};

// The picture, at most `width` characters wide, each line ended. A larger plane is shown in means of square
// blocks. In colour a character is two cells above each other (▀); without, one of " .:-=+*#%@" is the mean
// of the two. NaN and infinities are shown as '?' (in colour: magenta).
std::string heat_map(const Plane&, const Scale&, std::size_t width, bool colour);

// The scale as one line: its colours between its two ends.
std::string legend(const Scale&, bool colour);

}  // namespace shm_protocol::dump
