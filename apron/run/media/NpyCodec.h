// Encodes and decodes NumPy's .npy format, versions 1 to 3:
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
#pragma once

#include <string>
#include <string_view>

#include "apron/vm/Plane.h"

namespace apron::run {

// Throws MediaError for a damaged or truncated file, an unsupported element type or a wrong shape. path is
// for messages only.
void decode_npy(const std::string& path, std::string_view bytes, const vm::Plane& to);
std::string encode_npy(const vm::ConstPlane& from);

}  // namespace apron::run
