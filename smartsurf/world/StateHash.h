// A 64-bit hash of a state's bits, equal for equal bits on every machine and instruction set.
//
// Not cryptographic. The result depends on how the values are split into calls.
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

  // Long arrays are hashed in this many independent chains: a single chain would be bound by the latency of its
  // multiplication.
  static constexpr std::size_t kChains = 32;

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace smartsurf::world
