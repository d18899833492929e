// SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA 2014).
#pragma once

#include <cstdint>

namespace common {

inline constexpr std::uint64_t kSplitMix64Step = 0x9e3779b97f4a7c15U;  // from state to state

// The number that follows the state z; also a hash of z. That at position `n` from 0 follows
// z + n·kSplitMix64Step.
constexpr std::uint64_t splitmix64(std::uint64_t z) noexcept {
  z += kSplitMix64Step;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31);
}

// The next number of a stream, and its state after it.
constexpr std::uint64_t next_splitmix64(std::uint64_t& state) noexcept {
  const std::uint64_t number = splitmix64(state);
  state += kSplitMix64Step;
  return number;
}

}  // namespace common
