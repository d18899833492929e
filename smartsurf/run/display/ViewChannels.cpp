#include "smartsurf/run/display/ViewChannels.h"

namespace smartsurf::run {

view::Channel height_channel(const scene::SurfaceSpec& surface) {
  return {"height",
          "u",
          {},
          static_cast<float>(surface.pin.min_height),
          static_cast<float>(surface.pin.max_height)};
}

view::Channel sensor_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  for (const scene::SensorChannel& channel : scene::collect_channels(surface.sensors))
    if (channel.name == name)
      return {
          name, channel.unit, {}, static_cast<float>(channel.minimum), static_cast<float>(channel.maximum)};
  return {name, "", {}, 0.0F, 0.0F};
}

view::Channel actuator_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  for (const scene::ActuatorChannel& channel : surface.actuator_channels())
    if (channel.name == name)
      return {"command: " + name,
              channel.unit,
              {},
              static_cast<float>(channel.minimum),
              static_cast<float>(channel.maximum)};
  return {"command: " + name, "", {}, 0.0F, 0.0F};
}

void ViewChannels::init_channels(const simulation::Simulation& simulation) {
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  channels_ = {height_channel(surface)};
  for (const scene::ChannelData& sensor : simulation.sensors())
    channels_.push_back(sensor_channel(surface, std::string(sensor.name)));
  for (const scene::ChannelData& actuator : simulation.actuators())
    channels_.push_back(actuator_channel(surface, std::string(actuator.name)));
}

std::span<const view::Channel> ViewChannels::update(const simulation::Simulation& simulation,
                                                    const scene::Snapshot& snapshot) {
  const auto sensors = simulation.sensors(), actuators = simulation.actuators();
  if (channels_.size() != 1 + sensors.size() + actuators.size()) init_channels(simulation);
  const bool is_current = &snapshot == &simulation.snapshot();
  channels_[0].values = snapshot.height;
  for (std::size_t i = 0; i < sensors.size() + actuators.size(); ++i) {
    const scene::ChannelData& channel = i < sensors.size() ? sensors[i] : actuators[i - sensors.size()];
    channels_[1 + i].values =
        is_current && channel.components == 1 ? channel.values : std::span<const float>{};
  }
  return channels_;
}

std::vector<view::ContactMark> contact_marks(const simulation::Simulation& simulation) {
  const auto dt_s = static_cast<float>(simulation.scene().world.dt_s);
  std::vector<view::ContactMark> marks;
  for (const world::ContactPoint& contact : simulation.contacts())
    marks.push_back({contact.point, contact.normal * (contact.impulse / dt_s)});
  return marks;
}

}  // namespace smartsurf::run
