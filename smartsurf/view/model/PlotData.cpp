#include "smartsurf/view/model/PlotData.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "common/color/LineColours.h"
#include "common/csv/Csv.h"
#include "common/text/Number.h"

namespace smartsurf::view {

bool PlotData::contains(const Signal& signal) const {
  return std::ranges::find(series_, signal, &Series::signal) != series_.end();
}

// A new series is filled by the next update().
void PlotData::add(const Signal& signal) {
  if (!contains(signal)) series_.push_back({signal, {}});
}

void PlotData::remove(const Signal& signal) {
  std::erase_if(series_, [&](const Series& series) { return series.signal == signal; });
}

void PlotData::set(const std::vector<Signal>& signals) {
  std::vector<Series> series;
  for (const Signal& signal : signals) {
    const auto existing = std::ranges::find(series_, signal, &Series::signal);
    series.push_back(existing != series_.end() ? std::move(*existing) : Series{signal, {}});
  }
  series_ = std::move(series);
}

void PlotData::invalidate() {
  times_.clear();
  begin_ = end_ = 0;
  for (Series& series : series_) series.values.clear();
}

void PlotData::update(const History& history) {
  if (history.end() < end_ || history.begin() > end_ || history.begin() < begin_) invalidate();
  if (times_.empty()) begin_ = end_ = history.begin();
  const auto dropped = static_cast<std::ptrdiff_t>(history.begin() - begin_);
  const std::size_t count = history.end() - history.begin();
  const auto drop_and_extend = [&](std::vector<double>& values) {
    values.erase(values.begin(), values.begin() + std::min<std::ptrdiff_t>(dropped, std::ssize(values)));
    const std::size_t old_count = values.size();
    values.resize(count);
    return old_count;
  };
  for (std::size_t i = drop_and_extend(times_); i < count; ++i)
    times_[i] = history.time_s(history.begin() + i);
  for (Series& series : series_) {
    const std::size_t known = drop_and_extend(series.values);
    history.read(series.signal, history.begin() + known, std::span(series.values).subspan(known));
  }
  begin_ = history.begin();
  end_ = history.end();
}

// The charts' colours; then darker and lighter ones.
std::array<std::uint8_t, 3> curve_colour(std::size_t index) {
  constexpr std::size_t kColours = std::size(common::kLineColours);
  static_assert(kCurveColours == 3 * kColours);
  const std::size_t shade = index / kColours % 3;
  const auto byte = [&](double c) {
    return static_cast<std::uint8_t>(std::lround(255.0 * (shade == 0   ? c
                                                          : shade == 1 ? 0.5 * c
                                                                       : c + 0.45 * (1.0 - c))));
  };
  const common::Rgba& colour = common::kLineColours[index % kColours];
  return {byte(colour.r), byte(colour.g), byte(colour.b)};
}

std::vector<Signal> signals_to_add(const SceneItem& item, std::span<const Channel> channels,
                                   const PlotData& plotted) {
  const bool is_object = item.kind == SceneItem::Kind::kObject;
  std::vector<Signal> suitable, usual;
  for (Signal& signal : signals_of(item, channels)) {
    const auto shows_quantity = [&](const PlotData::Series& series) {
      return series.signal.kind == signal.kind && series.signal.quantity == signal.quantity;
    };
    if (usual.empty() && (!is_object || signal.quantity == "speed")) usual.push_back(signal);
    if (std::ranges::any_of(plotted.series(), shows_quantity)) suitable.push_back(std::move(signal));
  }
  return suitable.empty() ? usual : suitable;
}

std::string to_csv(const PlotExport& plot) {
  std::string text = "time_s";
  for (const PlotExport::Series& series : plot.series) {
    text += ',';
    common::append_csv_field(text,
                             series.unit.empty() ? series.name : series.name + " [" + series.unit + "]");
  }
  text += '\n';
  for (std::size_t i = 0; i < plot.times.size(); ++i) {
    common::append_shortest(text, plot.times[i]);
    for (const PlotExport::Series& series : plot.series) {
      text += ',';
      if (std::isfinite(series.values[i])) common::append_shortest(text, series.values[i]);
    }
    text += '\n';
  }
  return text;
}

std::vector<CurvePoint> reduce_curve(std::span<const double> times, std::span<const double> values,
                                     double from, double to, int columns) {
  std::vector<CurvePoint> points;
  const auto column_of = [&](double time_s) {
    return std::floor((time_s - from) / std::max(to - from, 1e-12) * columns);
  };
  // One sample more on either side, so that the curve reaches the edges.
  std::size_t first = std::ranges::lower_bound(times, from) - times.begin();
  std::size_t last = std::ranges::upper_bound(times, to) - times.begin();
  first -= first > 0 ? 1 : 0;
  last += last < times.size() ? 1 : 0;
  for (std::size_t i = first; i < last;) {
    const double column = column_of(times[i]);
    std::size_t least = i, most = i, next = i;
    bool has_gap = false;
    for (; next < last && column_of(times[next]) == column; ++next) {
      if (std::isnan(values[next])) {
        has_gap = true;
        continue;
      }
      if (std::isnan(values[least]) || values[next] < values[least]) least = next;
      if (std::isnan(values[most]) || values[next] > values[most]) most = next;
    }
    const auto [early, late] = std::minmax(least, most);
    if (std::isfinite(values[least])) {
      points.push_back({times[early], values[early]});
      if (late != early) points.push_back({times[late], values[late]});
    }
    if (has_gap) points.push_back({times[i], std::numeric_limits<double>::quiet_NaN()});
    i = next;
  }
  return points;
}

}  // namespace smartsurf::view
