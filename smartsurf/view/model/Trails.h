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

  // Adds the positions of one frame and drops points older than length_s. The first frame, an earlier time
  // than the last, and one more than length_s after it fill the trails from the input's history instead, as
  // far as it goes back.
  void add(const FrameInput& input, double length_s);
  void clear();
  // Appends the trails in their objects' colours; the alpha decreases with age.
  void append_lines(const std::vector<scene::ObjectSpec>& catalogue, std::vector<Line>& lines) const;

 private:
  struct Point {
    std::array<float, 3> position;
    double time_s;
  };
  void add_points(const scene::Snapshot& snapshot);

  float min_step_;
  bool started_ = false;
  double now_s_ = 0.0, length_s_ = 0.0;
  std::vector<std::deque<Point>> points_;  // indexed by object id; oldest first
};

}  // namespace smartsurf::view
