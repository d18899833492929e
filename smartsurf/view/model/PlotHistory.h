// The recent history of one object's or cell's quantities, for live plots. No OpenGL.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/view/interaction/Picking.h"

namespace smartsurf::view {

class PlotHistory {
 public:
  struct Series {
    std::string name, unit;
    std::vector<float> values;  // oldest first; NaN: no value
    float latest() const { return values.back(); }
  };

  // Adds one sample of `item`, at most one per tick. A different item or an earlier time clears the history.
  void add(const SceneItem& item, const scene::SurfaceSpec& surface, const FrameInput& input);
  const std::vector<Series>& series() const { return series_; }
  // Time between the oldest and the latest sample, simulated seconds.
  double span_s() const { return times_.empty() ? 0.0 : times_.back() - times_.front(); }

 private:
  void add_sample(const char* name, const char* unit, float value);

  SceneItem item_;
  std::vector<Series> series_;
  std::vector<double> times_;
  std::size_t next_series_ = 0;
};

}  // namespace smartsurf::view
