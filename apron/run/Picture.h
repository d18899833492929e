// A register as lines of text: for terminals, logs and pipes.
#pragma once

#include <cstdint>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// Large arrays are drawn smaller: a place stands for a block of cells and shows their mean; what is not a
// number counts as the least. The least mean is drawn darkest, the largest brightest. At least one place each
// way.
struct PictureSize {
  std::uint32_t columns = 80, rows = 24;  // of text, at most
};

// Two places a line, one above the other, in the 256 colours of a terminal, from dark blue over green to
// yellow.
std::string coloured_picture(const vm::ConstPlane& plane, const PictureSize& size);

// One place a line, in characters from ' ' to '@'.
std::string plain_picture(const vm::ConstPlane& plane, const PictureSize& size);

}  // namespace apron::run
