// Reads and writes array files, .npy (NumPy) and .csv, by extension. Row 0 of the file is row 0, north.
#pragma once

#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// Reads an array into a plane of exactly its shape. A .npy file has two dimensions, or one for a single row,
// and an integer, boolean or real type. Throws MediaError; the plane may then be partly written.
void read_array(const std::string& path, const vm::Plane& to);

// Writes little-endian float32 to .npy, and numbers that read back as the same floats to .csv. Throws
// MediaError.
void write_array(const std::string& path, const vm::ConstPlane& from);

}  // namespace apron::run
