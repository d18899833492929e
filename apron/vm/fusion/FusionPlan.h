// The schedule of a value graph: stages (operations fused into one loop over rows), each skewed by some rows
// against its inputs, in column strips with a halo that neighbouring strips compute twice.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Stage.h"
#include "apron/vm/fusion/ValueGraph.h"

namespace apron::vm {

struct FusionPlanOptions {
  unsigned threads = 1;
  // 0 is automatic for each of these.
  unsigned slices = 0;
  std::uint32_t strip_columns = 0;  // rounded up to whole vectors
  std::uint32_t block_rows = 0;
  std::uint32_t rows_per_iteration = 0;
};

// The array is divided into slices of rows, which threads take; each slice into strips of columns; each strip
// into blocks of rows, for each of which all stages run in order. Under the boundary rule wrap, a slice's
// halo continues beyond the north and south edge with the rows of the opposite side, and there is one strip.
struct FusionPlan {
  std::uint32_t width = 0, height = 0;
  BoundaryCondition boundary{};
  CellType type = CellType::kFloat32;
  std::vector<RowBuffer> buffers;
  std::vector<Stage> stages;
  unsigned threads = 1;
  unsigned slices = 1;              // a multiple of the threads if there are enough rows
  std::uint32_t strip_columns = 0;  // a multiple of lanes(type), or the whole width
  std::uint32_t block_rows = 0;
  std::uint32_t rows_per_iteration = 1;  // upper limit for generated code
  std::uint32_t ring_halo = 0;   // columns of the rings beyond a strip's own, a multiple of lanes(type)
  std::uint32_t ring_pitch = 0;  // cells between rows of a ring
  std::size_t worker_cells = 0;  // size of one worker's rings
};

// Schedules the graph over arrays of width x height. Allocates.
FusionPlan make_fusion_plan(const ValueGraph& graph, std::uint32_t width, std::uint32_t height,
                            const FusionPlanOptions& options);

}  // namespace apron::vm
