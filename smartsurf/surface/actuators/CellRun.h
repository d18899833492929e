// Adjacent cells of one row.
#pragma once

#include <algorithm>
#include <cstddef>

namespace smartsurf::surface {

// Cells [begin, end), as row-major indices.
struct CellRun {
  int begin = 0, end = 0;
};

inline std::size_t length_of(const CellRun& cells) { return cells.end - cells.begin; }
// The cells of both; none if its end is not after its begin.
inline CellRun common_cells(const CellRun& a, const CellRun& b) {
  return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

}  // namespace smartsurf::surface
