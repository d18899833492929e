#include "smartsurf/record/TimeSpentPlot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "smartsurf/scene/Outline.h"

namespace smartsurf::record {
namespace {

constexpr double kRight = 110.0, kBelow = 52.0, kScaleGap = 26.0, kScaleWidth = 16.0;
constexpr std::size_t kBlockNumbers = 1u << 20;

// The palette "viridis" at equal distances (CC0; S. van der Walt, N. Smith).
constexpr std::array<Ink, 6> kPalette{{{0.267, 0.005, 0.329},
                                       {0.254, 0.265, 0.530},
                                       {0.164, 0.471, 0.558},
                                       {0.135, 0.659, 0.518},
                                       {0.478, 0.821, 0.318},
                                       {0.993, 0.906, 0.144}}};

Ink colour_at(double t) {
  const double at = std::clamp(t, 0.0, 1.0) * (kPalette.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kPalette.size() - 2);
  const double part = at - static_cast<double>(i);
  const Ink &a = kPalette[i], &b = kPalette[i + 1];
  return {a.r + part * (b.r - a.r), a.g + part * (b.g - a.g), a.b + part * (b.b - a.b)};
}

std::uint32_t rgb(const Ink& ink) {
  const auto byte = [](double v) { return static_cast<std::uint32_t>(std::lround(255.0 * v)); };
  return byte(ink.r) << 16 | byte(ink.g) << 8 | byte(ink.b);
}

// Squares of the pitch that cover the surface: its cells, where they stand in a rectangular grid.
struct Squares {
  double west, south;
  int columns, rows;
};

Squares squares_of(const scene::SurfaceSpec& s) {
  const scene::Outline outline = scene::outline_of(s);
  if (s.places.empty()) return {outline.west, outline.south, s.columns, s.rows};
  const auto count = [&s](double length) {
    return std::max(1, static_cast<int>(std::ceil(length / s.pitch - 1e-6)));
  };
  return {outline.west, outline.south, std::min(count(outline.width()), 4096),
          std::min(count(outline.height()), 4096)};
}

Chart chart_of(const scene::SurfaceSpec& s) {
  const Squares all = squares_of(s);
  const double wide = all.columns * s.pitch, high = all.rows * s.pitch;
  const double points = 600.0 / std::max(wide, high);
  const Area area{66.0, 62.0, std::max(wide * points, 60.0), std::max(high * points, 60.0)};
  const double x = all.west, y = all.south;
  return {area, {x, x + wide, "x, east [u]"}, {y, y + high, "y, north [u]"}};
}

// Draws a picture of columns × rows pixels, the first row on top, without smoothing over an area of the
// paper.
void draw_pixels(cairo_t* paper, const Area& area, int columns, int rows, std::vector<std::uint32_t> pixels) {
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> image(
      cairo_image_surface_create_for_data(reinterpret_cast<unsigned char*>(pixels.data()), CAIRO_FORMAT_RGB24,
                                          columns, rows, 4 * columns),
      cairo_surface_destroy);
  cairo_save(paper);
  cairo_translate(paper, area.left, area.top);
  cairo_scale(paper, area.width / columns, area.height / rows);
  cairo_set_source_surface(paper, image.get(), 0.0, 0.0);
  cairo_pattern_set_filter(cairo_get_source(paper), CAIRO_FILTER_NEAREST);
  cairo_rectangle(paper, 0.0, 0.0, columns, rows);
  cairo_fill(paper);
  cairo_restore(paper);
}

}  // namespace

TimeSpentPlot::TimeSpentPlot(const Recording& recording, const std::string& label)
    : surface_(recording.spec().surface),
      title_("Time that " + (label.empty() ? std::string("objects") : "'" + label + "' objects") +
             " spent over each cell"),
      subtitle_(subtitle(recording)),
      chart_(chart_of(surface_)),
      seconds_(static_cast<std::size_t>(squares_of(surface_).columns) *
               static_cast<std::size_t>(squares_of(surface_).rows)) {
  std::vector<bool> counts;
  std::vector<std::string> labels;
  for (const scene::ObjectSpec& object : recording.spec().objects) {
    counts.push_back(!object.fixed && (label.empty() || object.label == label));
    labels.push_back(object.label);
  }
  if (!label.empty() && std::find(counts.begin(), counts.end(), true) == counts.end()) {
    const std::string near = scene::nearest_name(label, labels);
    throw scene::InputError("--what time-spent:" + label + ": no object carries this label" +
                            (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }
  sum_up(recording, counts);
  most_ = *std::max_element(seconds_.begin(), seconds_.end());
}

void TimeSpentPlot::sum_up(const Recording& recording, const std::vector<bool>& counts) {
  const Squares squares = squares_of(surface_);
  const std::size_t objects = counts.size(), frames = recording.frames();
  const std::size_t block = std::max<std::size_t>(1, kBlockNumbers / std::max<std::size_t>(3 * objects, 1));
  // A frame stands until the next; the last one ends the recording.
  for (std::size_t first = 0; first + 1 < frames; first += block) {
    const std::size_t count = std::min(block, frames - 1 - first);
    const std::vector<float> p = recording.positions(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      const double dt_s = recording.time()[first + f + 1] - recording.time()[first + f];
      for (std::size_t id = 0; id < objects; ++id) {
        const float* const at = &p[(f * objects + id) * 3];
        if (!counts[id] || !std::isfinite(at[0]) || !std::isfinite(at[1])) continue;
        const double column = std::floor((at[0] - squares.west) / surface_.pitch),
                     north = std::floor((at[1] - squares.south) / surface_.pitch);
        if (column < 0.0 || north < 0.0 || column >= squares.columns || north >= squares.rows) continue;
        const int row = squares.rows - 1 - static_cast<int>(north);
        seconds_[static_cast<std::size_t>(row * squares.columns + static_cast<int>(column))] += dt_s;
      }
    }
  }
}

double TimeSpentPlot::width() const { return chart_.area().right() + kRight; }
double TimeSpentPlot::height() const { return chart_.area().bottom() + kBelow; }

void TimeSpentPlot::draw_cells(cairo_t* paper) const {
  std::vector<std::uint32_t> pixels(seconds_.size());
  // The root: where objects rest they spend far more time than where they pass.
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = rgb(colour_at(most_ > 0.0 ? std::sqrt(seconds_[i] / most_) : 0.0));
  draw_pixels(paper, chart_.area(), squares_of(surface_).columns, squares_of(surface_).rows,
              std::move(pixels));
}

void TimeSpentPlot::draw_scale(cairo_t* paper) const {
  constexpr int kSteps = 128;
  const Area& area = chart_.area();
  const Area bar{area.right() + kScaleGap, area.top, kScaleWidth, std::min(area.height, 320.0)};
  std::vector<std::uint32_t> pixels;
  for (int i = 0; i < kSteps; ++i) pixels.push_back(rgb(colour_at(1.0 - (i + 0.5) / kSteps)));
  draw_pixels(paper, bar, 1, kSteps, std::move(pixels));
  use(paper, kBlack);
  cairo_rectangle(paper, bar.left, bar.top, bar.width, bar.height);
  cairo_stroke(paper);
  draw_text(paper, bar.left, bar.top - 8.0, "s", 12.0, Align::kLeft);
  double above = -INFINITY;
  for (const double value : round_numbers(0.0, std::max(most_, 1e-9))) {
    const double y = bar.bottom() - std::sqrt(value / std::max(most_, 1e-9)) * bar.height;
    if (value > 0.0 && above - y < 14.0) continue;  // the root crowds the numbers at the top
    above = y;
    draw_line(paper, bar.right(), y, bar.right() + 4.0, y);
    draw_text(paper, bar.right() + 7.0, y + 4.0, number_text(value), 11.0, Align::kLeft);
  }
}

void TimeSpentPlot::draw(cairo_t* paper) const {
  draw_cells(paper);
  chart_.draw_axes(paper);
  draw_scale(paper);
  use(paper, kBlack);
  const double widest = chart_.area().width + kRight - 20.0;
  draw_text(paper, chart_.area().left, 28.0, title_, 17.0, Align::kLeft, true, widest);
  use(paper, kGrey);
  draw_text(paper, chart_.area().left, 48.0, subtitle_, 12.0, Align::kLeft, false, widest);
}

}  // namespace smartsurf::record
