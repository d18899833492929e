#include "smartsurf/world/StateHash.h"

#include <array>
#include <bit>

namespace smartsurf::world {
namespace {

// Long arrays go through this many chains side by side: one chain waits for its multiplication at every word.
constexpr std::size_t kChains = 16;
constexpr std::uint32_t kOdd = 0x9e3779b1U;

}  // namespace

// FNV-1a over 32-bit words, with a rotation so that high bits reach low ones.
void StateHash::add(std::uint32_t word) noexcept {
  value_ = (value_ ^ word) * 0x100000001b3ULL;
  value_ = std::rotl(value_, 23);
}

void StateHash::add(std::span<const float> values) noexcept {
  std::size_t i = 0;
  if (values.size() >= 4 * kChains) {
    std::array<std::uint32_t, kChains> chain{};
    for (; i + kChains <= values.size(); i += kChains)
      for (std::size_t k = 0; k < kChains; ++k) {
        const std::uint32_t mixed = (chain[k] ^ std::bit_cast<std::uint32_t>(values[i + k])) * kOdd;
        chain[k] = mixed << 13U | mixed >> 19U;
      }
    for (const std::uint32_t c : chain) add(c);
  }
  for (; i < values.size(); ++i) add(std::bit_cast<std::uint32_t>(values[i]));
}

}  // namespace smartsurf::world
