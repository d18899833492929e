#include "shm-protocol/hardware/bridge/ClockSync.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace hardware {
namespace {

constexpr std::int64_t kPing_us = 62'500;       // sixteen a second
constexpr std::int64_t kFirstPing_us = 10'000;  // until the board is in phase
constexpr std::int64_t kShortestBaseline_us = 500'000, kLongestBaseline_us = 60'000'000;

}  // namespace

void ClockSync::reset() { *this = ClockSync(period_us_); }

ssw_sync ClockSync::next(std::int64_t now, std::int64_t epoch) {
  due_ = now + (estimates_ < 4 ? kFirstPing_us : kPing_us);
  ssw_sync sync{};
  sync.t1 = static_cast<std::uint32_t>(now);
  const std::int64_t period = period_us_;
  sync.table_tick = static_cast<std::uint32_t>((now - epoch) / period);
  sync.correction_us = SSW_KEEP;
  if (correct_) {
    sync.correction_us = static_cast<std::int32_t>(std::lround(-*phase_));
    sync.rate_ppb = static_cast<std::int32_t>(std::lround(rate_ppb_));
    correct_ = false;
  }
  return sync;
}

void ClockSync::receive(const ssw_clock& clock, std::int64_t now, std::int64_t epoch) {
  const auto low = static_cast<std::uint32_t>(now);
  const auto there = static_cast<std::int32_t>(clock.received - clock.t1);
  const std::uint32_t total = low - clock.t1, at_board = clock.sent - clock.received;
  // Too old, not a round trip, or a board that has not begun a period yet.
  if (total > 2'000'000 || at_board > total || clock.into_us > 4 * period_us_) return;
  // The board's clock minus the host's: the middle of both ways.
  const std::uint32_t offset =
      static_cast<std::uint32_t>(there) - static_cast<std::uint32_t>((total - at_board) / 2);
  const std::uint32_t board_began = clock.sent - clock.into_us;
  const auto back = static_cast<std::int32_t>(board_began - offset - low);
  recent_[count_ % kRoundTrips] = {static_cast<double>(total - at_board), now + back, board_began,
                                   clock.tick};
  ++count_;
  if (count_ >= (estimates_ < 4 ? 4 : kRoundTrips)) estimate(epoch);
}

void ClockSync::estimate(std::int64_t epoch) {
  const auto last = recent_.begin() + std::min(count_, kRoundTrips);
  std::sort(recent_.begin(), last,
            [](const RoundTrip& a, const RoundTrip& b) { return a.round_trip < b.round_trip; });
  best_ = recent_[0];
  count_ = 0;
  const auto period = static_cast<double>(period_us_);
  // The phase is the median over the round trips that took little longer than the fastest, because a board's
  // period may begin late once.
  const auto good = std::find_if(
      recent_.begin(), last, [&](const RoundTrip& r) { return r.round_trip > 1.2 * best_.round_trip + 20; });
  const auto phase_of = [&](const RoundTrip& r) {
    const double since = static_cast<double>(r.began - epoch);
    return since - period * std::round(since / period);
  };
  std::sort(recent_.begin(), good,
            [&](const RoundTrip& a, const RoundTrip& b) { return phase_of(a) < phase_of(b); });
  best_ = recent_[(good - recent_.begin()) / 2];
  const double phase = phase_of(best_);
  // How fast the board's clock runs, over up to a minute.
  const RoundTrip& r = best_;
  if (reference_ && r.began - reference_->began > kLongestBaseline_us)
    reference_ = std::exchange(candidate_, r);
  if (!reference_) reference_ = candidate_ = r;
  if (const std::int64_t host = r.began - reference_->began; host > kShortestBaseline_us) {
    const auto ahead =
        static_cast<std::int32_t>(r.board_began - reference_->board_began - static_cast<std::uint32_t>(host));
    rate_ppb_ = std::clamp(static_cast<double>(ahead) / static_cast<double>(host) * 1e9, -1e7, 1e7);
    if (host > kLongestBaseline_us / 2 && candidate_->began == reference_->began) candidate_ = r;
  }
  phase_ = phase;
  ++estimates_;
  correct_ = true;
}

std::optional<std::int64_t> ClockSync::table_tick(std::uint32_t board_tick, std::int64_t epoch) const {
  if (!phase_) return std::nullopt;
  const auto steps = static_cast<std::int32_t>(board_tick - best_.tick);
  const double began = static_cast<double>(best_.began - epoch) + static_cast<double>(steps) * period_us_;
  return std::llround(began / period_us_);
}

std::uint32_t ClockSync::board_clock(std::uint32_t board_tick) const {
  return best_.board_began + (board_tick - best_.tick) * period_us_;
}

}  // namespace hardware
