// Recent object trajectories over the last seconds of simulated time. No OpenGL.
#pragma once

#include <deque>
#include <vector>

#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {

class Trails {
 public:
  // pitch: of the surface, u; displacements below 0.15 pitches add no point.
  explicit Trails(double pitch) : min_step_(0.15F * static_cast<float>(pitch)) {}

  // Adds the positions of one frame and drops points older than length_s. An earlier time than the last, or
  // one more than length_s after it, clears the trails.
  void add(const FrameInput& input, double length_s);
  void clear();
  // Appends the trails in their objects' colours; the alpha decreases with age.
  void append_lines(const std::vector<scene::ObjectSpec>& catalogue, std::vector<Line>& lines) const;

 private:
  struct Point {
    std::array<float, 3> position;
    double time_s;
  };
  float min_step_;
  double now_s_ = 0.0, length_s_ = 0.0;
  std::vector<std::deque<Point>> points_;  // indexed by object id; oldest first
};

}  // namespace smartsurf::view
