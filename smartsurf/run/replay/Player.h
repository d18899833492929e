// The position in a recording being played: which frame is due, given the clock and the user's commands.
#pragma once

#include <cstddef>
#include <vector>

#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::run {

class Player {
 public:
  // time: of each frame, seconds, ascending, at least one; must outlive the player. pace: recorded seconds a
  // second; 0: a frame at every advance().
  Player(const std::vector<double>& frame_times, double pace);

  std::size_t frame() const;  // the last whose time has come
  bool paused() const { return paused_; }
  double pace() const { return pace_; }

  // Steps and seeks stop at the ends. Running on from the last frame begins anew.
  void apply(const view::Commands& commands);
  // So many seconds of the clock have passed; at the last frame it pauses.
  void advance(double wall_s);

 private:
  void seek(std::ptrdiff_t frame);

  const std::vector<double>& frame_times_;
  double pace_;
  double position_s_;
  bool paused_ = false;
};

}  // namespace smartsurf::run
