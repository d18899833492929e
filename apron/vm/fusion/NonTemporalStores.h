// Selects the results of a plan that are stored with non-temporal stores: planes larger than the caches that
// no stage reads again need not be fetched to be overwritten.
#pragma once

#include <cstddef>
#include <vector>

#include "apron/vm/Stage.h"

namespace apron::vm {

// Sets Stage::Result::non_temporal of complete stages on planes of that many bytes.
void select_non_temporal_stores(std::vector<Stage>& stages, const std::vector<RowBuffer>& buffers,
                                std::size_t bytes);

}  // namespace apron::vm
