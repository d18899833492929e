// Phase lock of boards with drifting clocks on simulated lines, against the true beginnings of their periods.
#include "shm-protocol/hardware/bridge/ClockSync.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <random>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {
namespace {

struct Line {
  std::int64_t due;
  std::vector<std::uint8_t> bytes;
};

// The firmware under a simulated clock, and the host's estimate, with a delay in each direction.
class Simulation {
 public:
  Simulation(std::uint32_t period_us, double drift_ppm, std::int64_t least_delay, std::int64_t jitter,
             unsigned seed)
      : sync_(period_us), drift_(1 + drift_ppm * 1e-6), least_(least_delay), jitter_(jitter), random_(seed) {
    const ssw_hello hello{0, 0, 1, 1, period_us, 1, 1, "clock"};
    ssd_init(
        &device_, &hello, channels_, 1,
        [](void* self, const std::uint8_t* b, std::size_t n) {
          auto& s = *static_cast<Simulation*>(self);
          s.up_.push_back({s.time_ + s.delay(), {b, b + n}});
          return 1;
        },
        this);
    device_.micros = [](void* self) { return static_cast<Simulation*>(self)->board_clock(); };
    period_end_ = static_cast<double>(random_() % period_us);
    to_board(SSW_START, {});
  }

  // Advances to `until` and returns the largest phase after `from`, µs.
  double run(std::int64_t from, std::int64_t until) {
    double worst = 0;
    const double period = device_.hello.period_us;
    for (; time_ < until; ++time_) {
      if (time_ >= sync_.due()) {
        std::vector<std::uint8_t> payload(SSW_SYNC_BYTES);
        const ssw_sync s = sync_.next(time_, 0);
        ssw_put_sync(&s, payload.data());
        to_board(SSW_SYNC, payload);
      }
      while (!down_.empty() && down_.front().due <= time_) {
        for (const std::uint8_t b : down_.front().bytes) ssd_receive(&device_, b);
        down_.pop_front();
      }
      while (!up_.empty() && up_.front().due <= time_) {
        ssw_packet packet;
        ssw_clock clock;
        for (const std::uint8_t b : up_.front().bytes)
          if (ssw_receive(&receiver_, b, &packet) && ssw_get_clock(&packet, &clock))
            sync_.receive(clock, time_, 0);
        up_.pop_front();
      }
      if (static_cast<double>(time_) >= period_end_) {
        const double phase = period_end_ - period * std::round(period_end_ / period);
        if (time_ >= from) worst = std::max(worst, std::abs(phase));
        ssd_period(&device_);
        period_end_ += ssd_period_us(&device_) / drift_;
      }
    }
    return worst;
  }
  const ClockSync& sync() const { return sync_; }

 private:
  std::int64_t delay() { return least_ + (jitter_ ? static_cast<std::int64_t>(random_() % jitter_) : 0); }
  std::uint32_t board_clock() const {
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(static_cast<double>(time_) * drift_)) +
           4'000'000'000u;
  }
  void to_board(std::uint8_t type, std::vector<std::uint8_t> payload) {
    std::vector<std::uint8_t> framed(SSW_MAX_ENCODED + 2);
    const ssw_packet packet{type, 0, 0, payload.data(), payload.size()};
    framed.resize(ssw_write(&packet, framed.data()));
    const std::int64_t due = time_ + delay();
    down_.push_back({down_.empty() ? due : std::max(due, down_.back().due), framed});
  }

  ClockSync sync_;
  double drift_, period_end_ = 0;
  std::int64_t least_, jitter_, time_ = 0;
  std::mt19937 random_;
  std::uint8_t value_ = 0;
  ssd_channel channels_[1] = {{{0, SSW_SENSOR, SSW_U8, 1, 0, 1, 0, 1, 0, "x", ""}, &value_, nullptr}};
  ssd_device device_;
  ssw_receiver receiver_{};
  std::deque<Line> down_, up_;
};

// After eight seconds, half the asymmetry of the fastest of 16 round trips and a microsecond of rounding are
// left.
TEST(ClockSync, BoardsComeIntoPhaseAndStay) {
  unsigned seed = 1;
  for (const std::uint32_t period : {5'000u, 16'667u})
    for (const double drift_ppm : {0.0, 100.0, -100.0, 2000.0}) {
      Simulation simulation(period, drift_ppm, 150, 300, seed++);
      const double worst = simulation.run(8'000'000, 20'000'000);
      EXPECT_LT(worst, 150 + std::abs(drift_ppm) * 0.05) << period << " µs, " << drift_ppm << " ppm";
      EXPECT_NEAR(simulation.sync().rate_ppb(), drift_ppm * 1000, 60'000 + 50 * std::abs(drift_ppm));
    }
}

TEST(ClockSync, TableTickOfABoardsTick) {
  Simulation simulation(10'000, 50, 100, 50, 9);
  simulation.run(0, 6'000'000);
  const auto tick = simulation.sync().table_tick(100, 0);
  ASSERT_TRUE(tick.has_value());
  EXPECT_NEAR(static_cast<double>(*tick), 100, 3);  // both began at zero
  EXPECT_EQ(*simulation.sync().table_tick(105, 0), *tick + 5);
}

}  // namespace
}  // namespace hardware
