// Axes with round tick values, text, lines and maps on a Cairo context, shared by all plots.
//
// Coordinates are in points from the figure's upper left corner; a PNG has two pixels per point.
#pragma once

#include <cairo.h>

#include <string>
#include <vector>

#include "common/axis/Axis.h"
#include "common/color/LineColours.h"

namespace common {

constexpr Rgba kBlack{0.13, 0.13, 0.13}, kGreyPen{0.45, 0.45, 0.45}, kLightGreyPen{0.88, 0.88, 0.88},
    kWhite{1, 1, 1};

enum class Align { kLeft, kCentre, kRight };

struct Axis {
  double min, max;  // in the data's unit, different; min > max: the axis is reversed
  std::string title;
  bool log = false;                          // 0 < min
  std::vector<std::string> categories = {};  // at 0, 1, …, instead of numbers
  // The position of a value: 0 at min, 1 at max.
  double fraction(double value) const;
};

struct PlotArea {
  double left, top, width, height;  // points
  double right() const { return left + width; }
  double bottom() const { return top + height; }
};

// The room that the tick labels and the title of a y axis need beside the area, at least 66 points.
double y_axis_room(const Axis& axis, double height);

// The room that the tick labels or the categories, and the title, of an x axis need below the area. Names of
// categories that do not fit side by side stand upright. height: of the area and that room.
double x_axis_room(const Axis& axis, double width, double height);

// A picture that can be drawn on any Cairo context.
class Figure {
 public:
  virtual ~Figure() = default;
  virtual double width() const = 0;  // points
  virtual double height() const = 0;
  virtual void draw(cairo_t* cr) const = 0;
};

// Maps data coordinates to points and draws the axes.
class Chart {
 public:
  // Widens axes that are too short to be divided.
  Chart(PlotArea area, Axis x, Axis y);
  const PlotArea& area() const { return area_; }
  double px(double x) const { return area_.left + x_.fraction(x) * area_.width; }
  double py(double y) const { return area_.bottom() - y_.fraction(y) * area_.height; }
  // Draws the frame, tick marks, tick labels and axis titles.
  void draw_axes(cairo_t* cr) const;
  void draw_grid(cairo_t* cr) const;  // a line at each tick of y
  // Clips to the area, and to `margin` points around it, until cairo_restore().
  void clip(cairo_t* cr, double margin = 0.0) const;

 private:
  void draw_categories(cairo_t* cr) const;

  PlotArea area_;
  Axis x_, y_;
};

// Draws pixels, row by row from the top, as rectangles that fill the area.
void draw_pixels(cairo_t* cr, const PlotArea& area, int columns, const std::vector<Rgba>& pixels);

void set_pen(cairo_t* cr, const Rgba& colour, double line_width = 1.0);
void draw_line(cairo_t* cr, double x1, double y1, double x2, double y2);
// The least share of a text's size at which it can be read.
inline constexpr double kMinTextScale = 0.7;
// Draws text with its baseline at y, no wider than `max_width`: scaled down to `min_scale`, then cut with
// "…".
void draw_text(cairo_t* cr, double x, double y, const std::string& text, double size, Align align,
               bool bold = false, double max_width = 1e9, double min_scale = kMinTextScale);
double text_width(cairo_t* cr, const std::string& text, double size);

}  // namespace common
