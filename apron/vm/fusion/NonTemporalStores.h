// Selects the results of a plan that are stored with non-temporal stores: planes larger than the caches that
// no stage reads again need not be fetched to be overwritten.
#pragma once

#include "apron/vm/fusion/FusionPlan.h"

namespace apron::vm {

// Sets Stage::Result::non_temporal. The rest of the plan must be complete.
void select_non_temporal_stores(FusionPlan&);

}  // namespace apron::vm
