// The position in a recording being played: which frame is due, given the clock and the user's commands.
#pragma once

#include <cstddef>
#include <vector>

#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::run {

class Player {
 public:
  // frame_times: s, ascending, at least one; must outlive the player. pace: recorded seconds per second; 0
  // shows the next frame at every advance().
  Player(const std::vector<double>& frame_times, double pace);

  std::size_t frame() const;  // the latest frame that is due
  bool paused() const { return paused_; }
  double pace() const { return pace_; }
  double position_s() const { return position_s_; }  // recorded time

  // Steps and seeks are clamped to the recording. Resuming at the last frame restarts from the first.
  void apply(const view::Commands& commands);
  // Advances by `wall_s` seconds of wall time; pauses at the last frame.
  void advance(double wall_s);

 private:
  void seek(std::ptrdiff_t frame);

  const std::vector<double>& frame_times_;
  double pace_;
  double position_s_;
  bool paused_ = false;
};

}  // namespace smartsurf::run
