// A 64-bit hash of the bits of a state, equal on every machine and run for equal bits.
#pragma once

#include <cstdint>
#include <span>

namespace smartsurf::world {

class StateHash {
 public:
  void add(std::span<const float> values) noexcept;
  void add(std::uint32_t value) noexcept;
  std::uint64_t value() const noexcept { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace smartsurf::world
