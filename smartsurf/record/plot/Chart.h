// The parts that all plots of recordings share: the drawing of common/chart, and their subtitle. Internal to
// this module.
#pragma once

#include <string>
#include <vector>

#include "common/chart/Chart.h"

namespace smartsurf::record {

class Recording;

using common::Align;
using common::Axis;
using common::axis_margin;
using common::Chart;
using common::draw_line;
using common::draw_pixels;
using common::draw_text;
using common::Figure;
using common::format_number;
using common::kBlack;
using common::kGreyPen;
using common::kLightGreyPen;
using common::kLineColours;
using common::kWhite;
using common::PlotArea;
using common::Rgba;
using common::set_pen;
using common::text_width;
using common::tick_labels;
using common::tick_values;
using common::x_axis_room;
using common::y_axis_room;

struct LineStyle {
  Rgba color;
  std::vector<double> dashes;
};
// The dashes that distinguish lines of one colour; the first is solid.
inline const std::vector<double> kLineDashes[] = {
    {}, {6.0, 3.5}, {1.5, 2.5}, {8.0, 3.0, 1.5, 3.0}, {12.0, 4.0}};

// The subtitle of every figure: "sort.lua · seed 1 · 0 to 45.2 s".
std::string subtitle(const Recording& recording);

}  // namespace smartsurf::record
