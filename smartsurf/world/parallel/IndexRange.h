// A half-open range of indices.
#pragma once

namespace smartsurf::world {

// [begin, end).
struct IndexRange {
  int begin, end;
};

}  // namespace smartsurf::world
