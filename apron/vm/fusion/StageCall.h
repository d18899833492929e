// One call of a stage, generated or interpreted: the rectangle of cells that it computes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace apron::vm {

inline constexpr std::size_t kMaxRowStreams = 14;

// A rectangle of cells, processed in iterations of one or more rows. Rows are 64-byte aligned; columns up to
// the next multiple of kLanes may be read and written.
struct StageCall {
  std::array<float*, kMaxRowStreams> row_start{};               // first cell of each stream's first row
  std::array<std::ptrdiff_t, kMaxRowStreams> row_step_bytes{};  // to the same row of the next iteration
  std::int64_t iterations = 0;
  std::int64_t row_bytes = 0;  // columns rounded up to kLanes, in bytes
  const float* scalar_slots = nullptr;
};

}  // namespace apron::vm
