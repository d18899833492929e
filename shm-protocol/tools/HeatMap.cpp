#include "HeatMap.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "common/color/Palette.h"

namespace shm_protocol::dump {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr char kRamp[] = " .:-=+*#%@";

// Viridis: brightness increases uniformly, so that the map is readable without colour vision.
common::Rgb colour_of(double fraction) {
  if (std::isnan(fraction)) return {1, 0, 1};
  return common::palette_color(common::Palette::kViridis, static_cast<float>(fraction));
}

std::string escape(int kind, const common::Rgb& colour) {
  const auto level = [&](int i) { return static_cast<int>(std::lround(255 * colour[i])); };
  char text[32];
  std::snprintf(text, sizeof text, "\033[%d;2;%d;%d;%dm", kind, level(0), level(1), level(2));
  return text;
}

// Maps to 0 … 1; NaN for non-finite values.
double normalize(double value, const Scale& scale) {
  if (!std::isfinite(value)) return kNaN;
  const double span = scale.high - scale.low;
  return span > 0 ? std::clamp((value - scale.low) / span, 0.0, 1.0) : 0.0;
}

// Means of block × block cells. A block with a non-finite value becomes NaN, so that averaging hides none.
std::vector<double> downsample(const Plane& plane, std::size_t block, std::size_t rows, std::size_t columns) {
  std::vector<double> sums(rows * columns), counts(rows * columns);
  for (std::size_t y = 0; y < plane.rows; ++y)
    for (std::size_t x = 0; x < plane.columns; ++x) {
      const std::size_t to = y / block * columns + x / block;
      const double v = plane.cells[y * plane.columns + x];
      sums[to] += std::isfinite(v) ? v : kNaN;
      counts[to] += 1;
    }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] /= counts[i];
  return sums;
}

char glyph_of(double fraction) {
  if (std::isnan(fraction)) return '?';
  return kRamp[std::min<std::size_t>(sizeof kRamp - 2, fraction * (sizeof kRamp - 1))];
}

}  // namespace

std::string heat_map(const Plane& plane, const Scale& scale, std::size_t width, bool colour) {
  const std::size_t block = (std::max(plane.columns, plane.rows / 2) + width - 1) / width;
  const std::size_t rows = (plane.rows + block - 1) / block, columns = (plane.columns + block - 1) / block;
  const std::vector<double> cells = downsample(plane, block, rows, columns);
  std::string out;
  for (std::size_t y = 0; y < rows; y += 2) {
    for (std::size_t x = 0; x < columns; ++x) {
      const double above = normalize(cells[y * columns + x], scale);
      const bool two = y + 1 < rows;
      const double below = two ? normalize(cells[(y + 1) * columns + x], scale) : above;
      if (!colour) {
        out += glyph_of((above + below) / 2);
      } else {
        if (two) out += escape(48, colour_of(below));
        out += escape(38, colour_of(above)) + "▀";
      }
    }
    out += colour ? "\033[0m\n" : "\n";
  }
  return out;
}

std::string legend(const Scale& scale, bool colour) {
  constexpr int kSteps = 20;
  char end[40];
  std::snprintf(end, sizeof end, "%.6g ", scale.low);
  std::string out = end;
  for (int i = 0; i < kSteps; ++i) {
    const double fraction = (i + 0.5) / kSteps;
    if (colour)
      out += escape(48, colour_of(fraction)) + " ";
    else if (i % 2 == 0)
      out += glyph_of(fraction);
  }
  std::snprintf(end, sizeof end, "%s %.6g", colour ? "\033[0m" : "", scale.high);
  return out + end;
}

}  // namespace shm_protocol::dump
