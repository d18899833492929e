#include "apron/run/cli/TerminalImage.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

namespace apron::run {
namespace {

// Colours of the terminal's 6x6x6 colour cube, dark to bright.
constexpr std::array<int, 10> kAnsiShades{17, 18, 24, 30, 36, 42, 78, 114, 185, 227};
constexpr std::string_view kAsciiShades = " .:-=+*#%@";
static_assert(kAsciiShades.size() == kAnsiShades.size());
constexpr const char* kUpperHalfBlock = "\u2580";

// Downsampled pixels as indices into the shade tables, row-major.
struct ShadeGrid {
  std::uint32_t width = 0, height = 0;
  std::vector<std::size_t> shades{};

  std::size_t at(std::uint32_t x, std::uint32_t y) const { return shades[std::size_t{y} * width + x]; }
};

// The mean of the block's finite cells; NaN if there are none.
double block_mean(const vm::ConstPlane& plane, std::uint32_t x, std::uint32_t y, std::uint32_t block) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::uint32_t row = y; row < std::min(y + block, plane.height); ++row)
    for (std::uint32_t column = x; column < std::min(x + block, plane.width); ++column)
      if (const float cell = vm::cell_as_float(plane, column, row); std::isfinite(cell)) {
        sum += static_cast<double>(cell);
        ++count;
      }
  return count > 0 ? sum / static_cast<double>(count) : std::nan("");
}

ShadeGrid shade_grid(const vm::ConstPlane& plane, std::uint32_t columns, std::uint32_t rows) {
  const auto blocks = [](std::uint32_t cells, std::uint32_t most) { return (cells + most - 1) / most; };
  const std::uint32_t block = std::max(blocks(plane.width, columns), blocks(plane.height, rows));
  ShadeGrid grid{blocks(plane.width, block), blocks(plane.height, block)};
  std::vector<double> means;
  for (std::uint32_t y = 0; y < grid.height; ++y)
    for (std::uint32_t x = 0; x < grid.width; ++x)
      means.push_back(block_mean(plane, x * block, y * block, block));
  double min_mean = INFINITY, max_mean = -INFINITY;
  for (const double mean : means) {
    min_mean = std::fmin(min_mean, mean);
    max_mean = std::fmax(max_mean, mean);
  }
  for (const double mean : means) {
    const double fraction =
        max_mean > min_mean && !std::isnan(mean) ? (mean - min_mean) / (max_mean - min_mean) : 0.0;
    grid.shades.push_back(static_cast<std::size_t>(std::lround(fraction * double{kAnsiShades.size() - 1})));
  }
  return grid;
}

}  // namespace

std::string render_ansi(const vm::ConstPlane& plane, const TerminalSize& limits) {
  const ShadeGrid grid = shade_grid(plane, std::max(limits.columns, 1U), std::max(limits.rows, 1U) * 2);
  std::string text;
  for (std::uint32_t y = 0; y < grid.height; y += 2) {
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      text += fmt::format("\x1b[38;5;{}m", kAnsiShades[grid.at(x, y)]);
      if (y + 1 < grid.height) text += fmt::format("\x1b[48;5;{}m", kAnsiShades[grid.at(x, y + 1)]);
      text += kUpperHalfBlock;
    }
    text += "\x1b[0m\x1b[K\n";
  }
  return text;
}

std::string render_ascii(const vm::ConstPlane& plane, const TerminalSize& limits) {
  const ShadeGrid grid = shade_grid(plane, std::max(limits.columns, 1U), std::max(limits.rows, 1U));
  std::string text;
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    for (std::uint32_t x = 0; x < grid.width; ++x) text += kAsciiShades[grid.at(x, y)];
    text += '\n';
  }
  return text;
}

}  // namespace apron::run
