// The signals of a plot with their values in all stored frames. No OpenGL.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/axis/Axis.h"
#include "smartsurf/view/model/Signal.h"

namespace smartsurf::view {

class PlotData {
 public:
  struct Series {
    Signal signal;
    std::vector<double> values;  // one per time; NaN: no value
  };

  bool contains(const Signal& signal) const;
  void add(const Signal& signal);  // no-op if it is there
  void remove(const Signal& signal);
  // Replaces all signals; those that stay keep their values.
  void set(const std::vector<Signal>& signals);
  // Call when the history starts again, for example after a restart. The signals stay.
  void invalidate();

  // Reads the frames that are new since the last call, and drops those that the history has dropped.
  void update(const History& history);

  bool empty() const { return series_.empty(); }
  const std::vector<Series>& series() const { return series_; }
  // Simulated times of the stored frames, s, ascending. Index 0: the oldest frame of the history.
  const std::vector<double>& times() const { return times_; }

 private:
  std::vector<Series> series_;
  std::vector<double> times_;
  std::uint64_t begin_ = 0, end_ = 0;  // the frames that times_ holds
};

// The colour of the plotted signal of that index, sRGB in bytes: no two of the first kCurveColours are equal.
inline constexpr std::size_t kCurveColours = 21;
std::array<std::uint8_t, 3> curve_colour(std::size_t index);

// The signals of an item that suit the plots: the quantities that they show of other objects or cells;
// without any, an object's speed or a cell's first channel.
std::vector<Signal> signals_to_add(const SceneItem& item, std::span<const Channel> channels,
                                   const PlotData& plotted);

// A finished plot, to be written to a file.
struct PlotExport {
  std::string file;  // .csv or .png
  std::vector<double> times;
  struct Series {
    std::string name, unit;
    std::vector<double> values;
  };
  std::vector<Series> series;
};
// One column per signal after `time_s`; a value that does not exist is an empty field.
std::string to_csv(const PlotExport& plot);

using common::round_up;

// Reduces the samples [begin, end) of a curve to points for `columns` pixel columns over the times [from,
// to]: where several samples share a column, its least and largest in the order of their times. NaN separates
// pieces.
struct CurvePoint {
  double time_s, value;
};
std::vector<CurvePoint> reduce_curve(std::span<const double> times, std::span<const double> values,
                                     double from, double to, int columns);

}  // namespace smartsurf::view
