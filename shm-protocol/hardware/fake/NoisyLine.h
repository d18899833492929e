// A noisy line: loses, corrupts and delays bytes, driven by a seeded random generator.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

namespace hardware {

struct NoiseOptions {
  double drop = 0, corrupt = 0;        // probability per byte
  std::chrono::microseconds delay{0};  // maximum per burst; the order is preserved
  std::uint64_t seed = 1;
};

// One direction of the line. The caller supplies the times, which must not decrease.
class NoisyLine {
 public:
  using Time = std::chrono::nanoseconds;

  explicit NoisyLine(const NoiseOptions& options) : options_(options), random_(options.seed) {}

  void send(const std::uint8_t* bytes, std::size_t count, Time now) {
    Burst burst{std::max(now + random_delay(), last_), {}};
    for (std::size_t i = 0; i < count; ++i) {
      if (chance(options_.drop)) {
        ++dropped;
        continue;
      }
      std::uint8_t byte = bytes[i];
      if (chance(options_.corrupt)) {
        byte ^= static_cast<std::uint8_t>(1u << (random_() & 7u));
        ++corrupted;
      }
      burst.bytes.push_back(byte);
    }
    last_ = burst.due;
    pending_bytes_ += burst.bytes.size();
    bursts_.push_back(std::move(burst));
  }

  // Appends to `to` the bytes that have arrived by `now`.
  void receive(Time now, std::vector<std::uint8_t>& to) {
    for (; !bursts_.empty() && bursts_.front().due <= now; bursts_.pop_front()) {
      to.insert(to.end(), bursts_.front().bytes.begin(), bursts_.front().bytes.end());
      pending_bytes_ -= bursts_.front().bytes.size();
    }
  }
  // Arrival time of the next burst.
  std::optional<Time> next_arrival() const {
    return bursts_.empty() ? std::nullopt : std::optional(bursts_.front().due);
  }
  void clear() {
    bursts_.clear();
    pending_bytes_ = 0;
  }
  std::size_t pending_bytes() const { return pending_bytes_; }
  void set_noise(double drop, double corrupt) { options_.drop = drop, options_.corrupt = corrupt; }

  std::uint64_t dropped = 0, corrupted = 0;

 private:
  struct Burst {
    Time due;
    std::vector<std::uint8_t> bytes;
  };

  // Uses the generator's bits instead of a distribution, so that all standard libraries give equal results.
  bool chance(double p) { return p > 0 && static_cast<double>(random_() >> 11) * 0x1p-53 < p; }
  Time random_delay() {
    const auto most = static_cast<std::uint64_t>(options_.delay.count());
    return most == 0 ? Time(0) : std::chrono::microseconds(random_() % (most + 1));
  }

  NoiseOptions options_;
  std::mt19937_64 random_;
  std::deque<Burst> bursts_;
  std::size_t pending_bytes_ = 0;
  Time last_{0};
};

}  // namespace hardware
