#include "smartsurf/world/StateHash.h"

#include <bit>

namespace smartsurf::world {

// FNV-1a over 32-bit words, with a rotation so that high bits reach low ones.
void StateHash::add(std::uint32_t word) noexcept {
  value_ = (value_ ^ word) * 0x100000001b3ULL;
  value_ = std::rotl(value_, 23);
}

void StateHash::add(std::span<const float> values) noexcept {
  for (const float v : values) add(std::bit_cast<std::uint32_t>(v));
}

}  // namespace smartsurf::world
