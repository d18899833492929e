// Renders a register as lines of text, for terminals, logs and pipes.
#pragma once

#include <cstdint>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// Large arrays are drawn smaller: a place stands for a block of cells and shows their mean; what is not a
// number counts as the least. The least mean is drawn darkest, the largest brightest. At least one place each
// way.
struct TerminalSize {
  std::uint32_t columns = 80, rows = 24;  // of text, at most
};

// Two places a line, one above the other, in the 256 colours of a terminal, from dark blue over green to
// yellow.
std::string render_ansi(const vm::ConstPlane& plane, const TerminalSize& limits);

// One place a line, in characters from ' ' to '@'.
std::string render_ascii(const vm::ConstPlane& plane, const TerminalSize& limits);

}  // namespace apron::run
