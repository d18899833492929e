// The limits that the shared-memory protocol sets to the names and units of channels.
#pragma once

#include <cstddef>

namespace smartsurf::scene {

inline constexpr std::size_t kMaxChannelNameLength = 31, kMaxChannelUnitLength = 15;
inline constexpr std::size_t kMaxSensorNameLength = 27;  // its channels' names have a suffix

}  // namespace smartsurf::scene
