#include "smartsurf/simulation/ControllerLink.h"

#include <algorithm>
#include <cstdint>

#include "smartsurf/simulation/Simulation.h"

namespace smartsurf::simulation {

void ControllerLink::start_episode(const scene::SceneSpec& scene) {
  const scene::SurfaceSpec& spec = scene.surface;
  const std::size_t cells = spec.cell_count();
  common::ControlledSurface surface{spec.rows, spec.columns, scene.world.control_period_s, {}, {}};
  is_whole_.clear();
  whole_readings_.clear();
  for (const scene::SensorChannel& channel : spec.observed_channels()) {
    surface.sensors.push_back({channel.name, channel.components, 0.0});
    is_whole_.push_back(channel.type == scene::SensorChannel::Type::kUint32);
    whole_readings_.emplace_back(is_whole_.back() ? cells * channel.components : 0);
  }
  occupancy_ = spec.occupancy();
  targets_.clear();
  for (const scene::ActuatorChannel& channel : spec.actuator_channels()) {
    surface.actuators.push_back({channel.name, 1, channel.safe_value});
    targets_.insert(targets_.end(), cells, static_cast<float>(channel.safe_value));
  }
  frame_.resize(surface.sensors.size());
  answer_.clear();
  for (std::size_t i = 0; i < surface.actuators.size(); ++i)
    answer_.push_back(std::span(targets_).subspan(i * cells, cells));
  if (controller_ && surface == surface_) return controller_->restart();
  controller_ = factory_->create(surface);
  surface_ = std::move(surface);
}

bool ControllerLink::command(Simulation& simulation) {
  const std::span<const scene::ChannelData> sensors = simulation.sensors();
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    frame_[i] = sensors[i].values;
    if (!is_whole_[i]) continue;
    // In the type in which the protocol transfers the channel.
    std::ranges::transform(sensors[i].values, whole_readings_[i].begin(),
                           [](float value) { return static_cast<float>(static_cast<std::uint32_t>(value)); });
    frame_[i] = whole_readings_[i];
  }
  if (!occupancy_.empty()) frame_.back() = occupancy_;
  const scene::Snapshot& snapshot = simulation.partial_snapshot();
  switch (controller_->answer({snapshot.tick, snapshot.time_s, frame_}, answer_)) {
    case common::ControllerStatus::kEnded:
      return false;
    case common::ControllerStatus::kFailed:
      throw scene::InputError("the controller has failed: " + controller_->error());
    case common::ControllerStatus::kAnswered:
      break;
  }
  for (std::size_t i = 0; i < answer_.size(); ++i)
    simulation.actuator_array().set_targets(static_cast<int>(i), answer_[i]);
  return true;
}

}  // namespace smartsurf::simulation
