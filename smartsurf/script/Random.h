// The experiment's random numbers: SplitMix64, integer arithmetic only, so the same seed gives the same
// numbers on every machine. (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA
// 2014.)
#pragma once

#include <cstdint>

namespace smartsurf::script {

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next();
  // In [0, 1), one of 2^53 equally spaced values.
  double uniform_unit();
  // In [low, high), or low where both are equal. Requires low ≤ high, both finite.
  double uniform(double low, double high);
  // In [low, high], every integer equally likely. Requires low ≤ high.
  std::int64_t uniform_integer(std::int64_t low, std::int64_t high);

 private:
  std::uint64_t state_;
};

}  // namespace smartsurf::script
