#include "smartsurf/run/replay/Player.h"

#include <algorithm>

namespace smartsurf::run {

Player::Player(const std::vector<double>& frame_times, double pace)
    : frame_times_(frame_times), pace_(pace), position_s_(frame_times.front()) {}

std::size_t Player::frame() const {
  const auto after = std::upper_bound(frame_times_.begin(), frame_times_.end(), position_s_ + 1e-9);
  return std::max<std::ptrdiff_t>(after - frame_times_.begin() - 1, 0);
}

void Player::apply(const view::Commands& commands) {
  if (commands.toggle_pause) {
    paused_ = !paused_;
    if (!paused_ && frame() + 1 == frame_times_.size()) position_s_ = frame_times_.front();
  }
  if (commands.pace) pace_ = *commands.pace;
  if (commands.seek) seek(*commands.seek);
  if (commands.seek_time_s)
    seek(std::ranges::lower_bound(frame_times_, *commands.seek_time_s) - frame_times_.begin());
  if (commands.steps == 0) return;
  paused_ = true;
  seek(static_cast<std::ptrdiff_t>(frame()) + commands.steps);
}

void Player::advance(double wall_s) {
  if (paused_) return;
  if (pace_ > 0.0)
    position_s_ += wall_s * pace_;
  else
    seek(frame() + 1);
  if (position_s_ < frame_times_.back()) return;
  position_s_ = frame_times_.back();
  paused_ = true;
}

void Player::seek(std::ptrdiff_t frame) {
  const std::ptrdiff_t last = std::ssize(frame_times_) - 1;
  position_s_ = frame_times_[std::clamp<std::ptrdiff_t>(frame, 0, last)];
}

}  // namespace smartsurf::run
