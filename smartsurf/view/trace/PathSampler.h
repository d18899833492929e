// Random numbers of a path: Owen-scrambled Sobol points, shuffled for every pair of dimensions (Burley
// 2020). A number is a function of the pixel, the sample and its place in the path alone. Pixels that are
// near each other take parts of the same sequence, so that their errors differ (Ahmed and Wonka 2020).
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>

namespace smartsurf::view {

class PathSampler {
 public:
  // sample: below `samples`.
  PathSampler(std::uint32_t x, std::uint32_t y, std::uint32_t sample, std::uint32_t samples,
              std::uint32_t seed)
      : index_(reversed(interleaved(x & kTileMask, y & kTileMask) * std::bit_ceil(samples) + sample)),
        seed_(mixed(seed ^ mixed((x / kTile) ^ mixed(y / kTile)))) {}

  // Both in [0, 1).
  Eigen::Vector2f next() {
    const std::uint32_t seed = mixed(seed_ + dimension_++ * 0x9e3779b9U);
    const std::uint32_t index = reversed(scrambled(index_, seed));
    return {to_unit(reversed(scrambled(index, mixed(seed ^ 0xa5a5a5a5U)))),
            to_unit(reversed(scrambled(pascal(index), mixed(seed ^ 0x5a5a5a5aU))))};
  }

 private:
  static constexpr std::uint32_t kTile = 256, kTileMask = kTile - 1;  // pixels

  static std::uint32_t interleaved(std::uint32_t x, std::uint32_t y) {
    std::uint32_t bits = 0;
    for (int i = 0; i < 8; ++i) bits |= ((x >> i & 1U) << (2 * i)) | ((y >> i & 1U) << (2 * i + 1));
    return bits;
  }
  static std::uint32_t mixed(std::uint32_t x) {
    x = (x ^ (x >> 16)) * 0x7feb352dU;
    x = (x ^ (x >> 15)) * 0x846ca68bU;
    return x ^ (x >> 16);
  }
  static std::uint32_t reversed(std::uint32_t x) {
    x = __builtin_bswap32(x);
    x = ((x & 0x0f0f0f0fU) << 4) | ((x >> 4) & 0x0f0f0f0fU);
    x = ((x & 0x33333333U) << 2) | ((x >> 2) & 0x33333333U);
    return ((x & 0x55555555U) << 1) | ((x >> 1) & 0x55555555U);
  }
  // The second Sobol sequence with its bits in reverse: the index times Pascal's triangle modulo 2.
  static std::uint32_t pascal(std::uint32_t index) {
    index ^= (index >> 1) & 0x55555555U;
    index ^= (index >> 2) & 0x33333333U;
    index ^= (index >> 4) & 0x0f0f0f0fU;
    index ^= (index >> 8) & 0x00ff00ffU;
    return index ^ (index >> 16);
  }
  // Owen's scrambling of a number with its bits in reverse: each bit is flipped by a hash of those below it.
  static std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
    x += seed;
    x ^= x * 0x6c50b47cU;
    x ^= x * 0xb82f1e52U;
    x ^= x * 0xc7afe638U;
    return x ^ (x * 0x8d22f6e6U);
  }
  static float to_unit(std::uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24F; }

  std::uint32_t index_;  // with its bits in reverse
  std::uint32_t seed_, dimension_ = 0;
};

}  // namespace smartsurf::view
