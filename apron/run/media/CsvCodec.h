// Comma-separated numbers, one line per row.
#pragma once

#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

// Blank lines are skipped, blanks around numbers too. Throws MediaError, with line and field, for a text that
// is no number and for a wrong shape. path is for messages only.
void decode_csv(const std::string& path, std::string_view text, const vm::Plane& to);
std::string encode_csv(const vm::ConstPlane& from);

}  // namespace apron::run
