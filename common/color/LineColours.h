// The colours of lines in charts.
#pragma once

namespace common {

struct Rgba {
  double r, g, b, a = 1.0;  // sRGB in [0, 1]
};

// For colour-blind readers (Okabe and Ito), and a grey.
constexpr Rgba kLineColours[] = {{0.00, 0.45, 0.70}, {0.84, 0.37, 0.00}, {0.00, 0.62, 0.45},
                                 {0.80, 0.47, 0.65}, {0.34, 0.71, 0.91}, {0.90, 0.62, 0.00},
                                 {0.35, 0.35, 0.35}};

}  // namespace common
