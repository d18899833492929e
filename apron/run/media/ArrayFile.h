// Arrays in files: NumPy's .npy and .csv, by extension. Row 0 of the file is row 0, north.
#pragma once

#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// Reads a two-dimensional array (or a one-dimensional one, as one row) of any integer, boolean or real type
// into a plane of exactly its shape. Throws MediaError; the plane may then be partly written.
void read_array(const std::string& path, const vm::Plane& to);

// .npy: little-endian float32; .csv: numbers that read back as the same floats. Throws MediaError.
void write_array(const std::string& path, const vm::ConstPlane& from);

}  // namespace apron::run
