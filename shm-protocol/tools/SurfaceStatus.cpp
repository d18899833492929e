#include "SurfaceStatus.h"

#include <algorithm>
#include <cmath>

namespace shm_protocol::dump {

std::vector<double> values(const ObserverEndpoint& observer, int channel) {
  const auto all = [](auto span) { return std::vector<double>(span.begin(), span.end()); };
  switch (observer.description().channels[static_cast<std::size_t>(channel)].dtype) {
    case DType::kU32:
      return all(observer.array<std::uint32_t>(channel));
    case DType::kU8:
      return all(observer.array<std::uint8_t>(channel));
    default:
      return all(observer.array<float>(channel));
  }
}

ValueStatistics value_statistics(const std::vector<double>& numbers) {
  ValueStatistics s;
  std::size_t finite = 0;
  for (const double v : numbers) {
    if (!std::isfinite(v)) {
      ++s.non_finite;
      continue;
    }
    s.minimum = finite ? std::min(s.minimum, v) : v;
    s.maximum = finite ? std::max(s.maximum, v) : v;
    s.mean += v;
    ++finite;
  }
  if (finite) s.mean /= static_cast<double>(finite);
  return s;
}

}  // namespace shm_protocol::dump
