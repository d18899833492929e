// The values of one sensor or actuator channel over the surface at one moment.
#pragma once

#include <span>
#include <string_view>

namespace smartsurf::scene {

// Recorded or published data; SensorChannel and ActuatorChannel declare the channel.
struct ChannelData {
  std::string_view name;  // without '/'; the same channels in the same order in every frame
  int rows = 0, columns = 0, components = 1;
  // components × rows × columns, row-major, one plane per component, row 0 north; in the channel's unit.
  std::span<const float> values;
};

}  // namespace smartsurf::scene
