// What the numbers of a loop must be for it to end.
#pragma once

#include <string>

#include "apron/program/ScalarArithmetic.h"

namespace apron::program {

inline constexpr double kMaxLoopCount = kMaxWholeScalar - 1;  // a counter is that plus 1 at the end

// "", or why no `for` counts from `from` to `to` in steps of `step`.
std::string check_for(double from, double to, double step);
// "", or why no `repeat` has that many rounds.
std::string check_repeat(double rounds);

}  // namespace apron::program
