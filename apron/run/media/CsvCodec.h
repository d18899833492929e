// Encodes and decodes comma-separated numbers, one line per row.
#pragma once

#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

// Ignores blank lines and whitespace around numbers. Throws MediaError for a field that is not a number (with
// line and field), and for a wrong shape. path is for messages only.
void decode_csv(const std::string& path, std::string_view text, const vm::Plane& to);
std::string encode_csv(const vm::ConstPlane& from);

}  // namespace apron::run
