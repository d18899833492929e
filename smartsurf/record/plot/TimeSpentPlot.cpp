#include "smartsurf/record/plot/TimeSpentPlot.h"

#include <algorithm>
#include <cmath>

#include "common/color/Palette.h"
#include "common/text/Suggestion.h"
#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::record {
namespace {

constexpr double kRightMargin = 110.0, kBottomMargin = 52.0, kColourBarGap = 26.0, kColourBarWidth = 16.0;
constexpr std::size_t kBlockValues = 1u << 20;

Rgba sample_viridis(double t) {
  const common::Rgb color = common::palette_color(common::Palette::kViridis, static_cast<float>(t));
  return {color[0], color[1], color[2]};
}

// A grid of squares, one pitch wide, that covers the surface; in a rectangular layout these are its cells.
struct PlotGrid {
  double west, south;
  int columns, rows;
};

PlotGrid make_plot_grid(const scene::SurfaceSpec& s) {
  const scene::SurfaceBounds outline = scene::compute_surface_bounds(s);
  if (s.cell_poses.empty()) return {outline.west, outline.south, s.columns, s.rows};
  const auto count = [&s](double length) {
    return std::max(1, static_cast<int>(std::ceil(length / s.pitch - 1e-6)));
  };
  return {outline.west, outline.south, std::min(count(outline.width()), 4096),
          std::min(count(outline.height()), 4096)};
}

Chart make_chart(const scene::SurfaceSpec& s) {
  const PlotGrid grid = make_plot_grid(s);
  const double width = grid.columns * s.pitch, height = grid.rows * s.pitch;
  const double points = 600.0 / std::max(width, height);
  const double x = grid.west, y = grid.south, area_height = std::max(height * points, 60.0);
  const Axis north{y, y + height, "y, north [u]"};
  const PlotArea area{y_axis_room(north, area_height), 62.0, std::max(width * points, 60.0), area_height};
  return {area, {x, x + width, "x, east [u]"}, north};
}

}  // namespace

TimeSpentPlot::TimeSpentPlot(const Recording& recording, const std::string& label)
    : surface_(recording.spec().surface),
      title_("Time that " + (label.empty() ? std::string("objects") : "'" + label + "' objects") +
             " spent over each cell"),
      subtitle_(subtitle(recording)),
      chart_(make_chart(surface_)),
      seconds_(make_plot_grid(surface_).columns * make_plot_grid(surface_).rows) {
  std::vector<bool> included;
  std::vector<std::string> labels;
  for (const scene::ObjectSpec& object : recording.spec().objects) {
    included.push_back(!object.fixed && (label.empty() || object.label == label));
    labels.push_back(object.label);
  }
  if (!label.empty() && std::find(included.begin(), included.end(), true) == included.end())
    throw scene::InputError("--what time-spent:" + label + ": no object has this label" +
                            common::did_you_mean(label, labels));
  accumulate(recording, included);
  max_seconds_ = *std::max_element(seconds_.begin(), seconds_.end());
}

void TimeSpentPlot::accumulate(const Recording& recording, const std::vector<bool>& included) {
  const PlotGrid grid = make_plot_grid(surface_);
  const std::size_t objects = included.size(), frames = recording.frames();
  const std::size_t block = std::max<std::size_t>(1, kBlockValues / std::max<std::size_t>(3 * objects, 1));
  // A frame lasts until the next one; the last frame has no duration.
  for (std::size_t first = 0; first + 1 < frames; first += block) {
    const std::size_t count = std::min(block, frames - 1 - first);
    const std::vector<float> p = recording.read_positions(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      const double dt_s = recording.times()[first + f + 1] - recording.times()[first + f];
      for (std::size_t id = 0; id < objects; ++id) {
        const float* const position = &p[(f * objects + id) * 3];
        if (!included[id] || !std::isfinite(position[0]) || !std::isfinite(position[1])) continue;
        const double column = std::floor((position[0] - grid.west) / surface_.pitch),
                     north = std::floor((position[1] - grid.south) / surface_.pitch);
        if (column < 0.0 || north < 0.0 || column >= grid.columns || north >= grid.rows) continue;
        const int row = grid.rows - 1 - static_cast<int>(north);
        seconds_[row * grid.columns + static_cast<int>(column)] += dt_s;
      }
    }
  }
}

double TimeSpentPlot::width() const { return chart_.area().right() + kRightMargin; }
double TimeSpentPlot::height() const { return chart_.area().bottom() + kBottomMargin; }

void TimeSpentPlot::draw_cells(cairo_t* cr) const {
  std::vector<Rgba> pixels(seconds_.size());
  // The square root makes short visits visible beside cells where objects rest.
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = sample_viridis(max_seconds_ > 0.0 ? std::sqrt(seconds_[i] / max_seconds_) : 0.0);
  draw_pixels(cr, chart_.area(), make_plot_grid(surface_).columns, pixels);
}

void TimeSpentPlot::draw_colour_bar(cairo_t* cr) const {
  constexpr int kSteps = 128;
  const PlotArea& area = chart_.area();
  const PlotArea bar{area.right() + kColourBarGap, area.top, kColourBarWidth, std::min(area.height, 320.0)};
  std::vector<Rgba> pixels;
  for (int i = 0; i < kSteps; ++i) pixels.push_back(sample_viridis(1.0 - (i + 0.5) / kSteps));
  draw_pixels(cr, bar, 1, pixels);
  set_pen(cr, kBlack);
  cairo_rectangle(cr, bar.left, bar.top, bar.width, bar.height);
  cairo_stroke(cr);
  draw_text(cr, bar.left, bar.top - 8.0, "s", 12.0, Align::kLeft);
  double previous_y = -INFINITY;
  const double top = std::max(max_seconds_, 1e-9);
  const std::vector<double> ticks = tick_values(0.0, top);
  const std::vector<std::string> labels = tick_labels(ticks);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double y = bar.bottom() - std::sqrt(ticks[i] / top) * bar.height;
    if (i > 0 && previous_y - y < 14.0) continue;  // skip labels that would overlap
    previous_y = y;
    draw_line(cr, bar.right(), y, bar.right() + 4.0, y);
    draw_text(cr, bar.right() + 7.0, y + 4.0, labels[i], 11.0, Align::kLeft);
  }
}

void TimeSpentPlot::draw(cairo_t* cr) const {
  draw_cells(cr);
  chart_.draw_axes(cr);
  draw_colour_bar(cr);
  set_pen(cr, kBlack);
  const double max_width = chart_.area().width + kRightMargin - 20.0;
  draw_text(cr, chart_.area().left, 28.0, title_, 17.0, Align::kLeft, true, max_width);
  set_pen(cr, kGreyPen);
  draw_text(cr, chart_.area().left, 48.0, subtitle_, 12.0, Align::kLeft, false, max_width);
}

}  // namespace smartsurf::record
