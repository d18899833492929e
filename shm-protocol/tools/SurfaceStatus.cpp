#include "SurfaceStatus.h"

#include <algorithm>
#include <cmath>

namespace shm_protocol::dump {

std::vector<double> values(const ObserverEndpoint& observer, int channel) {
  return with_element_type(observer.description().channels[channel].dtype, [&]<class T>(T) {
    const std::span<const T> array = observer.array<T>(channel);
    return std::vector<double>(array.begin(), array.end());
  });
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
