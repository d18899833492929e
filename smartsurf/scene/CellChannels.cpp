#include "smartsurf/scene/CellChannels.h"

#include <algorithm>

#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::scene {

CellChannels::CellChannels(const SurfaceSpec& surface)
    : of_surface_(surface.actuator_channels()),
      actuator_of_cell_(surface.actuator_of_cell),
      cells_(surface.cell_count()) {
  for (const ActuatorSpec& actuator : surface.effective_actuators()) {
    auto& own = of_actuator_.emplace_back(of_surface_.size());
    for (const ActuatorChannel& channel : find_actuator_kind(actuator.model)->channels(actuator))
      own[std::ranges::find(of_surface_, channel.name, &ActuatorChannel::name) - of_surface_.begin()] =
          channel;
  }
}

const ActuatorChannel* CellChannels::find(std::size_t channel, std::size_t cell) const {
  const int actuator = actuator_of_cell_.empty() ? 0 : actuator_of_cell_[cell];
  if (actuator == kEmptyCell) return nullptr;
  const std::optional<ActuatorChannel>& own = of_actuator_[actuator][channel];
  return own ? &*own : nullptr;
}

std::vector<float> CellChannels::safe_values(std::size_t channel) const {
  std::vector<float> values(cells_);
  for (std::size_t cell = 0; cell < cells_; ++cell) {
    const ActuatorChannel* own = find(channel, cell);
    values[cell] = static_cast<float>((own != nullptr ? *own : of_surface_[channel]).safe_value);
  }
  return values;
}

}  // namespace smartsurf::scene
