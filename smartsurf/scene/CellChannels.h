// The actuator channels of single cells: kinds that share a channel may differ in its range and safe value.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

class CellChannels {
 public:
  explicit CellChannels(const SurfaceSpec&);

  // The channel of the cell's own actuator, null if it has none. channel: index in
  // SurfaceSpec::actuator_channels().
  const ActuatorChannel* find(std::size_t channel, std::size_t cell) const;
  // The safe value of every cell; the surface's for cells without the channel.
  std::vector<float> safe_values(std::size_t channel) const;

 private:
  std::vector<ActuatorChannel> of_surface_;
  std::vector<std::vector<std::optional<ActuatorChannel>>> of_actuator_;  // [actuator][channel]
  std::vector<std::int8_t> actuator_of_cell_;                             // as the surface's
  std::size_t cells_;
};

}  // namespace smartsurf::scene
