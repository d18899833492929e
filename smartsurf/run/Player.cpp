#include "smartsurf/run/Player.h"

#include <algorithm>

namespace smartsurf::run {

Player::Player(const std::vector<double>& time, double pace)
    : time_(time), pace_(pace), now_s_(time.front()) {}

std::size_t Player::frame() const {
  const auto after = std::upper_bound(time_.begin(), time_.end(), now_s_ + 1e-9);
  return static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - time_.begin() - 1, 0));
}

void Player::obey(const view::Commands& commands) {
  if (commands.toggle_pause) {
    paused_ = !paused_;
    if (!paused_ && frame() + 1 == time_.size()) now_s_ = time_.front();
  }
  if (commands.pace) pace_ = *commands.pace;
  if (commands.seek) go_to(static_cast<std::ptrdiff_t>(*commands.seek));
  if (commands.steps == 0) return;
  paused_ = true;
  go_to(static_cast<std::ptrdiff_t>(frame()) + commands.steps);
}

void Player::advance(double wall_s) {
  if (paused_) return;
  if (pace_ > 0.0)
    now_s_ += wall_s * pace_;
  else
    go_to(static_cast<std::ptrdiff_t>(frame()) + 1);
  if (now_s_ < time_.back()) return;
  now_s_ = time_.back();
  paused_ = true;
}

void Player::go_to(std::ptrdiff_t frame) {
  const auto last = static_cast<std::ptrdiff_t>(time_.size()) - 1;
  now_s_ = time_[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(frame, 0, last))];
}

}  // namespace smartsurf::run
