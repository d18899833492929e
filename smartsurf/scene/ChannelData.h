// A view of the values of one sensor or actuator channel in one tick.
#pragma once

#include <span>
#include <string_view>

namespace smartsurf::scene {

// Does not own its data. SensorChannel and ActuatorChannel describe the channel.
struct ChannelData {
  std::string_view name;  // without '/'; every tick has the same channels in the same order
  int rows = 0, columns = 0, components = 1;
  // [component][row][column], row 0 is north, column 0 is west; in the channel's unit.
  std::span<const float> values;
};

}  // namespace smartsurf::scene
