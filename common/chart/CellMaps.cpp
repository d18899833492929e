#include "common/chart/CellMaps.h"

#include <cairo-svg.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <memory>
#include <stdexcept>

#include "common/chart/Chart.h"
#include "common/color/Palette.h"

namespace common {
namespace {

constexpr int kAcross = 4;
constexpr double kWide = 190, kMargin = 24, kTitle = 34, kLegend = 44, kBar = 8;

Rgba colour(double t) {
  const Rgb c = palette_color(Palette::kViridis, static_cast<float>(t));
  return {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])};
}

std::string rounded(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.3g", value);
  return digits;
}

void draw_map(cairo_t* cr, const PlotArea& area, int columns, const CellMap& map) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const double v : map.values)
    if (std::isfinite(v)) least = std::min(least, v), most = std::max(most, v);
  // A cell is many pixels, because viewers blur the edges of large ones.
  const int rows = static_cast<int>(std::ssize(map.values)) / columns, size = std::max(1, 320 / columns);
  std::vector<Rgba> pixels;
  for (int y = 0; y < rows * size; ++y)
    for (int x = 0; x < columns * size; ++x) {
      const double v = map.values[y / size * columns + x / size];
      pixels.push_back(!std::isfinite(v) ? kGreyPen
                                         : colour(most > least ? (v - least) / (most - least) : 0.5));
    }
  draw_text(cr, area.left, area.top - 8, map.title, 12, Align::kLeft, true, area.width);
  draw_pixels(cr, area, columns * size, pixels);
  if (!std::isfinite(least)) return;
  const PlotArea bar{area.left, area.bottom() + 8, area.width, kBar};
  std::vector<Rgba> scale;
  for (int i = 0; i < 64; ++i) scale.push_back(colour(i / 63.0));
  draw_pixels(cr, bar, 64, scale);
  draw_text(cr, bar.left, bar.bottom() + 13, rounded(least), 11, Align::kLeft);
  draw_text(cr, bar.right(), bar.bottom() + 13, rounded(most), 11, Align::kRight);
}

}  // namespace

std::string cell_maps_svg(const std::string& title, int rows, int columns, const std::vector<CellMap>& maps) {
  const double high = kWide * rows / columns;
  const auto down = (std::ssize(maps) + kAcross - 1) / kAcross;
  std::string bytes;
  const auto append = [](void* to, const unsigned char* data, unsigned count) {
    static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(data), count);
    return CAIRO_STATUS_SUCCESS;
  };
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_svg_surface_create_for_stream(append, &bytes, kMargin + kAcross * (kWide + kMargin),
                                          2 * kTitle + static_cast<double>(down) * (high + kTitle + kLegend)),
      cairo_surface_destroy);
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> cr(cairo_create(surface.get()), cairo_destroy);
  set_pen(cr.get(), kWhite);
  cairo_paint(cr.get());
  set_pen(cr.get(), kBlack);
  draw_text(cr.get(), kMargin, kTitle - 6, title, 15, Align::kLeft, true);
  for (std::ptrdiff_t i = 0; i < std::ssize(maps); ++i) {
    set_pen(cr.get(), kBlack);
    draw_map(cr.get(),
             {kMargin + static_cast<double>(i % kAcross) * (kWide + kMargin),
              2 * kTitle + static_cast<double>(i / kAcross) * (high + kTitle + kLegend), kWide, high},
             columns, maps[i]);
  }
  cairo_surface_finish(surface.get());
  if (const cairo_status_t status = cairo_surface_status(surface.get()); status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("cannot draw: ") + cairo_status_to_string(status));
  return bytes;
}

}  // namespace common
