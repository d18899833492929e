// A file of custom palettes: one palette a line, its name and then its colours from low to high.
//
//     // comments and empty lines are ignored
//     ink      #ffffff #1b2027
//     warning  #00204d #ffd23f@0.8 #ff0000@0.8 #ff0000
//
// @POSITION, from 0 to 1, places a colour. The first lies at 0 and the last at 1 unless they say otherwise;
// the others are spaced equally between their neighbours.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/color/Palette.h"

namespace common {

// file: as errors name it. Throws UserError, "FILE:LINE: …".
std::vector<CustomPalette> parse_palettes(std::string_view text, const std::string& file);

}  // namespace common
