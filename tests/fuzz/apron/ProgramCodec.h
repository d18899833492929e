// Any bytes as a program, and a program as the bytes that give it: what the verifier is tried with. Every
// field of a program comes from the bytes as it is, right or wrong; bytes that are missing are zero.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "apron/program/Program.h"

namespace fuzz {

apron::program::Program decode(const std::uint8_t* data, std::size_t size);

// decode() of it is the program again, for programs of at most 65535 of each thing.
std::vector<std::uint8_t> encode(const apron::program::Program& program);

}  // namespace fuzz
