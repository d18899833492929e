// The random number generator of an experiment: SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom
// Number Generators, OOPSLA 2014). It uses integer arithmetic only, so a seed gives the same sequence on
// every machine.
#pragma once

#include <cstdint>
#include <string_view>

namespace smartsurf::script {

class Random {
 public:
  explicit Random(std::uint64_t seed = 0) : state_(seed) {}
  // The stream of a seed for one purpose. Streams of different purposes, and Random(seed), are independent.
  static Random stream(std::uint64_t seed, std::string_view purpose);

  std::uint64_t next();
  // In [0, 1), a multiple of 2^-53.
  double uniform_unit();
  // In [low, high); low if both are equal. Requires low ≤ high, both finite.
  double uniform(double low, double high);
  // Uniform in [low, high]. Requires low ≤ high.
  std::int64_t uniform_integer(std::int64_t low, std::int64_t high);

 private:
  std::uint64_t state_;
};

}  // namespace smartsurf::script
