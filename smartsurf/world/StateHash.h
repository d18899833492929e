// A 64-bit hash of the bits of a state, equal on every machine and run for equal bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace smartsurf::world {

class StateHash {
 public:
  void add(std::span<const float> values) noexcept;
  void add(std::uint32_t word) noexcept;
  std::uint64_t value() const noexcept { return value_; }

  // Long arrays go through this many chains side by side: one chain waits for its multiplication at every
  // word.
  static constexpr std::size_t kChains = 32;

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace smartsurf::world
