// Converts programs to bytes and arbitrary bytes to programs, for fuzzing the verifier. Fields are decoded
// without validation; missing bytes read as zero.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "apron/program/Program.h"

namespace fuzz {

apron::program::Program decode(const std::uint8_t* data, std::size_t size);

// The inverse of decode() for programs with at most 65535 entries in each table.
std::vector<std::uint8_t> encode(const apron::program::Program& program);

}  // namespace fuzz
