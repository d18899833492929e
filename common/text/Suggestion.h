// "Did you mean": the known name closest to a misspelt one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace common {

// The nearest candidate by edit distance (a swap of neighbours counts one), or one that differs only in case
// or in a prefix such as "math."; "" if none is near enough. Ties go to the first in alphabetical order.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

// "; did you mean 'X'?", or "".
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace common
