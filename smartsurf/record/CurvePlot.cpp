#include "smartsurf/record/CurvePlot.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::record {
namespace {

constexpr Area kArea{66.0, 62.0, 720.0, 340.0};
constexpr double kRight = 24.0, kBelow = 52.0, kLegendRow = 20.0, kLegendEntry = 180.0;
constexpr std::size_t kLegendColumns = 4;
constexpr double kColumns = 1440.0;  // beyond two points a pixel of paper, only the extremes can be seen

// Colours that the colour-blind can tell apart (Okabe and Ito).
constexpr Ink kInks[] = {{0.00, 0.45, 0.70}, {0.84, 0.37, 0.00}, {0.00, 0.62, 0.45}, {0.80, 0.47, 0.65},
                         {0.34, 0.71, 0.91}, {0.90, 0.62, 0.00}, {0.35, 0.35, 0.35}};

Ink ink_of(std::size_t i) { return kInks[i % std::size(kInks)]; }

Chart chart_of(const std::vector<double>& time, const Scalar& scalar) {
  double low = INFINITY, high = -INFINITY;
  for (const Curve& curve : scalar.curves)
    for (const double value : curve.value) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  if (!(low <= high)) low = 0.0, high = 1.0;
  // From zero where that wastes no more than a third of the paper.
  if (low > 0.0 && low < 0.5 * high) low = 0.0;
  const double margin = high > low ? 0.04 * (high - low) : std::max(0.5, 0.1 * std::abs(high));
  const double to = std::max(time.back(), time.front() + 1e-3);
  return {
      kArea, {time.front(), to, "time [s]"}, {low - (low == 0.0 ? 0.0 : margin), high + margin, scalar.axis}};
}

const std::vector<double>& checked_time(const Recording& recording) {
  if (recording.frames() == 0)
    throw scene::InputError(recording.path().string() + ": has no frames: there is nothing to draw");
  return recording.time();
}

}  // namespace

CurvePlot::CurvePlot(const Recording& recording, Scalar scalar)
    : time_(checked_time(recording)),
      scalar_(std::move(scalar)),
      subtitle_(subtitle(recording)),
      chart_(chart_of(time_, scalar_)) {}

double CurvePlot::width() const { return kArea.right() + kRight; }
double CurvePlot::height() const {
  const std::size_t rows =
      scalar_.curves.size() > 1 ? (scalar_.curves.size() + kLegendColumns - 1) / kLegendColumns : 0;
  return kArea.bottom() + kBelow + static_cast<double>(rows) * kLegendRow;
}

// Of the many frames of a long run each stretch of paper gets its first, least, greatest and last value.
void CurvePlot::draw_curve(cairo_t* paper, std::size_t i) const {
  const std::vector<double>& value = scalar_.curves[i].value;
  const std::size_t frames = std::min(value.size(), time_.size());
  const std::size_t bin =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(static_cast<double>(frames) / kColumns)));
  bool drawing = false;
  const auto go = [&](std::size_t f) {
    if (!std::isfinite(value[f])) {
      drawing = false;
      return;
    }
    (drawing ? cairo_line_to : cairo_move_to)(paper, chart_.px(time_[f]), chart_.py(value[f]));
    drawing = true;
  };
  for (std::size_t first = 0; first < frames; first += bin) {
    const std::size_t end = std::min(first + bin, frames);
    const auto [least, most] = std::minmax_element(value.begin() + static_cast<std::ptrdiff_t>(first),
                                                   value.begin() + static_cast<std::ptrdiff_t>(end));
    std::size_t marks[] = {first, static_cast<std::size_t>(least - value.begin()),
                           static_cast<std::size_t>(most - value.begin()), end - 1};
    std::sort(std::begin(marks), std::end(marks));
    for (std::size_t m = 0; m < std::size(marks); ++m)
      if (m == 0 || marks[m] != marks[m - 1]) go(marks[m]);
  }
  use(paper, ink_of(i), 1.8);
  cairo_set_line_join(paper, CAIRO_LINE_JOIN_ROUND);
  cairo_stroke(paper);
}

void CurvePlot::draw_legend(cairo_t* paper) const {
  for (std::size_t i = 0; i < scalar_.curves.size(); ++i) {
    const double x = kArea.left + static_cast<double>(i % kLegendColumns) * kLegendEntry;
    const double y = kArea.bottom() + kBelow + 4.0 + static_cast<double>(i / kLegendColumns) * kLegendRow;
    use(paper, ink_of(i), 2.4);
    draw_line(paper, x, y - 4.0, x + 22.0, y - 4.0);
    use(paper, kBlack);
    draw_text(paper, x + 28.0, y, scalar_.curves[i].name, 12.0, Align::kLeft, false, kLegendEntry - 36.0);
  }
}

void CurvePlot::draw(cairo_t* paper) const {
  chart_.clip(paper);
  for (std::size_t i = 0; i < scalar_.curves.size(); ++i) draw_curve(paper, i);
  cairo_restore(paper);
  chart_.draw_axes(paper);
  use(paper, kBlack);
  const std::string title =
      scalar_.curves.size() == 1 && scalar_.curves[0].name.find(' ') != std::string::npos
          ? scalar_.title + ": " + scalar_.curves[0].name
          : scalar_.title;
  draw_text(paper, kArea.left, 28.0, title, 17.0, Align::kLeft, true, kArea.width);
  use(paper, kGrey);
  draw_text(paper, kArea.left, 48.0, subtitle_, 12.0, Align::kLeft, false, kArea.width);
  if (scalar_.curves.size() > 1) draw_legend(paper);
}

}  // namespace smartsurf::record
