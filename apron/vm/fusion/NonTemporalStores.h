// Selects the results of a plan that are stored with non-temporal stores: planes larger than the caches that
// no stage reads again need not be fetched to be overwritten.
#pragma once

#include "apron/vm/fusion/FusionPlan.h"

namespace apron::vm {

// Sets Stage::Result::around_caches. The plan must be complete otherwise.
void select_non_temporal_stores(FusionPlan&);

}  // namespace apron::vm
