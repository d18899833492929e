// For aarch64: Eigen's arrays of floats are processed in packets of four, or one by one, as on x86-64.
#pragma once

#include <Eigen/Core>

namespace Eigen::internal {

// The library's own template takes Packet2f, half of a Packet4f, for sizes that are no multiples of four.
template <int Size>
struct find_best_packet_helper<Size, Packet4f, false> {
  using type = Packet4f;
};

}  // namespace Eigen::internal
