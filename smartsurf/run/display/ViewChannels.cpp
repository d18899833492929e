#include "smartsurf/run/display/ViewChannels.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "common/text/Suggestion.h"
#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::run {

using scene::ChannelKind;

view::Channel height_channel(const scene::SurfaceSpec& surface) {
  return {.name = "height",
          .unit = "u",
          .values = {},
          .low = static_cast<float>(surface.pin.min_height),
          .high = static_cast<float>(surface.pin.max_height),
          .kind = ChannelKind::kHeight};
}

view::Channel sensor_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  for (const scene::SensorChannel& channel : scene::collect_channels(surface.sensors))
    if (channel.name == name)
      return {name,
              channel.unit,
              {},
              static_cast<float>(channel.minimum),
              static_cast<float>(channel.maximum),
              channel.origin,
              channel.direction};
  return {name, "", {}, 0.0F, 0.0F};
}

view::Channel actuator_channel(const scene::SurfaceSpec& surface, const std::string& name) {
  for (const scene::ActuatorChannel& channel : surface.actuator_channels())
    if (channel.name == name)
      return {.name = full_name(ChannelKind::kCommand, name),
              .unit = channel.unit,
              .values = {},
              .low = static_cast<float>(channel.minimum),
              .high = static_cast<float>(channel.maximum),
              .kind = ChannelKind::kCommand};
  return {.name = full_name(ChannelKind::kCommand, name),
          .unit = "",
          .values = {},
          .kind = ChannelKind::kCommand};
}

std::string component_name(const std::string& name, int component, int components) {
  return components == 1 ? name : name + "[" + std::to_string(component) + "]";
}

view::Channel register_channel(const std::string& name) {
  return {.name = full_name(ChannelKind::kRegister, name),
          .unit = "",
          .values = {},
          .kind = ChannelKind::kRegister};
}

void ViewChannels::init_channels(const simulation::Simulation& simulation) {
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  channels_ = {height_channel(surface)};
  const auto add = [&](const scene::ChannelData& data, auto describe) {
    for (int i = 0; i < data.components; ++i) {
      channels_.push_back(describe(surface, std::string(data.name)));
      channels_.back().name = component_name(channels_.back().name, i, data.components);
    }
  };
  for (const scene::ChannelData& sensor : simulation.sensors()) add(sensor, sensor_channel);
  for (const scene::ChannelData& actuator : simulation.actuators()) add(actuator, actuator_channel);
  if (!registers_) return;
  for (const std::string& name : registers_->expected_names()) {
    channels_.push_back(register_channel(name));
    ++register_count_;
  }
  missing_.assign(surface.cell_count(), std::numeric_limits<float>::quiet_NaN());
}

std::span<const view::Channel> ViewChannels::update(const simulation::Simulation& simulation) {
  if (channels_.empty()) init_channels(simulation);
  const auto registers = registers_ ? registers_->values() : std::span<const scene::ChannelData>();
  for (view::Channel& channel : std::span(channels_).last(register_count_)) {
    const auto shown = std::ranges::find_if(registers, [&](const scene::ChannelData& data) {
      return channel.name == full_name(ChannelKind::kRegister, data.name);
    });
    channel.values = shown != registers.end() ? shown->values : std::span<const float>(missing_);
  }
  channels_[0].values = simulation.snapshot().height;
  std::size_t next = 1;
  for (const auto& group : {simulation.sensors(), simulation.actuators()})
    for (const scene::ChannelData& data : group) {
      const std::size_t cells = data.values.size() / data.components;
      for (int i = 0; i < data.components; ++i)
        channels_[next++].values = data.values.subspan(i * cells, cells);
    }
  return channels_;
}

std::span<const view::Channel> ViewChannels::show(const RunHistory& history, const RunHistory::Frame& frame) {
  for (std::size_t i = 0; i < channels_.size(); ++i) channels_[i].values = history.channel(frame, i);
  return channels_;
}

namespace {

// Throws unless `name` is one of the names of its kind ("channel"). hint: ends the message if no known name
// is like it.
void require_known(const std::string& flag, const std::string& name, const char* kind,
                   const std::vector<std::string>& known, const std::string& hint = "") {
  if (std::ranges::find(known, name) != known.end()) return;
  const std::string suggestion = common::nearest_name(name, known);
  throw scene::InputError(
      fmt::format("{} {}: no such {}{}; known: {}{}", flag, name, kind,
                  suggestion.empty() ? "" : fmt::format(" (did you mean '{}'?)", suggestion),
                  known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", ")),
                  suggestion.empty() && !hint.empty() ? "; " + hint : ""));
}

}  // namespace

void require_channel(const std::string& flag, const std::string& name,
                     std::span<const view::Channel> channels, const std::string& hint) {
  std::vector<std::string> known;
  for (const view::Channel& channel : channels) known.push_back(channel.name);
  require_known(flag, name, "channel", known, hint);
}

void require_metric(const std::string& flag, const std::string& name,
                    const std::vector<std::string>& metrics) {
  require_known(flag, name, "metric", metrics);
}

void require_signal(const std::string& flag, const view::Signal& signal, const scene::SurfaceSpec& surface,
                    std::span<const view::Channel> channels) {
  if (signal.kind != view::Signal::Kind::kCell) return;
  require_channel(flag, signal.quantity, channels);
  if (signal.row >= surface.rows || signal.column >= surface.columns)
    throw scene::InputError(fmt::format("{} {}: the surface has rows 0 to {} and columns 0 to {}", flag,
                                        to_string(signal), surface.rows - 1, surface.columns - 1));
}

std::vector<view::ContactMark> contact_marks(const simulation::Simulation& simulation) {
  const auto dt_s = static_cast<float>(simulation.scene().world.dt_s);
  std::vector<view::ContactMark> marks;
  for (const world::ContactPoint& contact : simulation.contacts())
    marks.push_back({contact.point, contact.normal * (contact.impulse / dt_s)});
  return marks;
}

}  // namespace smartsurf::run
