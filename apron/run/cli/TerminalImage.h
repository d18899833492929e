// Renders a register as lines of text, for terminals, logs and pipes.
#pragma once

#include <cstdint>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// The maximum size of the text. Larger arrays are downsampled: each pixel is the mean of the finite cells of
// a square block. Brightness scales linearly from the smallest mean to the largest; blocks without finite
// cells are darkest.
struct TerminalSize {
  std::uint32_t columns = 80, rows = 24;
};

// Two pixels per character, one above the other, in 256 terminal colours from dark blue over green to yellow.
std::string render_ansi(const vm::ConstPlane& plane, const TerminalSize& limits);

// One pixel per character, from ' ' to '@'.
std::string render_ascii(const vm::ConstPlane& plane, const TerminalSize& limits);

}  // namespace apron::run
