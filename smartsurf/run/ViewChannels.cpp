#include "smartsurf/run/ViewChannels.h"

namespace smartsurf::run {

view::Channel height_channel(const scene::SurfaceSpec& surface) {
  return {"height",
          "u",
          {},
          static_cast<float>(surface.pin.min_height),
          static_cast<float>(surface.pin.max_height)};
}

view::Channel sensor_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  const std::vector<std::string> names = surface.sensor_channels();
  for (std::size_t i = 0; i < surface.sensors.size(); ++i) {
    if (name == names[2 * i]) return {name, "u", {}, 0.0F, static_cast<float>(surface.sensors[i].range)};
    if (name == names[2 * i + 1]) return {name, "", {}, 0.0F, 1.0F};
  }
  return {name, "", {}, 0.0F, 0.0F};
}

view::Channel actuator_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  view::Channel channel{"command: " + name, "", {}, 0.0F, 0.0F};
  if (name != "height") return channel;
  const view::Channel height = height_channel(surface);
  return {channel.name, height.unit, {}, height.low, height.high};
}

void ViewChannels::name(const Simulation& simulation) {
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  channels_ = {height_channel(surface)};
  for (const record::Channel& sensor : simulation.sensors())
    channels_.push_back(sensor_channel(surface, std::string(sensor.name)));
  for (const record::Channel& actuator : simulation.actuators())
    channels_.push_back(actuator_channel(surface, std::string(actuator.name)));
}

std::span<const view::Channel> ViewChannels::of(const Simulation& simulation, const scene::Snapshot& shown) {
  const auto sensors = simulation.sensors(), actuators = simulation.actuators();
  if (channels_.size() != 1 + sensors.size() + actuators.size()) name(simulation);
  const bool now = &shown == &simulation.snapshot();
  channels_[0].values = shown.height;
  for (std::size_t i = 0; i < sensors.size() + actuators.size(); ++i) {
    const record::Channel& channel = i < sensors.size() ? sensors[i] : actuators[i - sensors.size()];
    channels_[1 + i].values = now && channel.components == 1 ? channel.values : std::span<const float>{};
  }
  return channels_;
}

}  // namespace smartsurf::run
