#include "smartsurf/script/Random.h"

#include <cassert>
#include <cmath>

#include "common/hash/Fnv.h"
#include "common/hash/SplitMix64.h"

namespace smartsurf::script {

Random Random::stream(std::uint64_t seed, std::string_view purpose) {
  return Random(Random(Random(seed).next() + common::fnv1a(purpose)).next());
}

std::uint64_t Random::next() { return common::next_splitmix64(state_); }

double Random::uniform_unit() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

double Random::uniform(double low, double high) {
  assert(low <= high);
  const double u = uniform_unit();
  const double value = low * (1.0 - u) + high * u;  // cannot overflow for finite bounds
  if (value < low) return low;
  return value >= high && high > low ? std::nextafter(high, low) : value;
}

std::int64_t Random::uniform_integer(std::int64_t low, std::int64_t high) {
  assert(low <= high);
  const std::uint64_t width = static_cast<std::uint64_t>(high) - static_cast<std::uint64_t>(low);
  if (width == UINT64_MAX) return static_cast<std::int64_t>(next());
  // Reject values above the largest multiple of `count`, which would bias the result towards `low`.
  const std::uint64_t count = width + 1;
  const std::uint64_t rejected = (UINT64_MAX % count + 1) % count;
  std::uint64_t draw = next();
  while (draw > UINT64_MAX - rejected) draw = next();
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(low) + draw % count);
}

}  // namespace smartsurf::script
