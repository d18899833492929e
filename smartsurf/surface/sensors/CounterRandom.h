// A counter-based random number generator: every number is a function of seed, stream, tick and index, so the
// order of draws and the thread do not matter.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/hash/SplitMix64.h"

namespace smartsurf::surface {

class CounterRandom {
 public:
  CounterRandom(std::uint64_t seed, std::uint64_t stream, std::uint64_t tick) noexcept
      : key_(common::splitmix64(common::splitmix64(common::splitmix64(seed) + stream) + tick)) {}

  // 64 random bits: SplitMix64 at position `index`.
  std::uint64_t bits(std::uint64_t index) const noexcept {
    return common::splitmix64(key_ + index * common::kSplitMix64Step);
  }

  // Uniform in [0, 1), a multiple of 2⁻⁵³.
  double uniform(std::uint64_t index) const noexcept {
    return static_cast<double>(bits(index) >> 11) * 0x1p-53;
  }

  // Standard normal by the Box-Muller transform; |x| < 6.8. Avoids the C library's functions, whose last bits
  // differ between platforms.
  double normal(std::uint64_t index) const noexcept {
    const std::uint64_t b = bits(index);
    const double u = (static_cast<double>(b >> 32) + 0.5) * 0x1p-32;
    // In [-1/2, 1/2).
    const double turns = static_cast<double>(static_cast<std::int32_t>(b & 0xffffffffU)) * 0x1p-32;
    return std::sqrt(-2.0 * log_approx(u)) * sin_turns(turns);
  }

 private:
  // ln u to 1e-10, for a normalized u > 0: u = m·2^e with m near 1, and ln m = 2 artanh((m − 1)/(m + 1)) as a
  // series.
  static double log_approx(double u) noexcept {
    const std::uint64_t b = std::bit_cast<std::uint64_t>(u);
    int exponent = static_cast<int>(b >> 52) - 1023;
    double m = std::bit_cast<double>((b & 0xfffffffffffffU) | 0x3ff0000000000000U);
    if (m > std::numbers::sqrt2) m *= 0.5, ++exponent;
    const double s = (m - 1.0) / (m + 1.0), q = s * s;
    const double series =
        1.0 + q * (1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11)))));
    return 2.0 * s * series + exponent * std::numbers::ln2;
  }

  // sin 2πt to 1e-9, for t in [-1/2, 1/2].
  static double sin_turns(double t) noexcept {
    if (t > 0.25) t = 0.5 - t;
    if (t < -0.25) t = -0.5 - t;
    const double a = 2.0 * std::numbers::pi * t, q = a * a;
    return a *
           (1.0 -
            q / 6 *
                (1.0 -
                 q / 20 *
                     (1.0 - q / 42 * (1.0 - q / 72 * (1.0 - q / 110 * (1.0 - q / 156 * (1.0 - q / 210)))))));
  }

  std::uint64_t key_;
};

}  // namespace smartsurf::surface
