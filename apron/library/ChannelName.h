// Names of channels and of their components, as programs write them in surface.sense and surface.actuate.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace apron::library {

struct NamedChannel {
  std::string name;
  bool is_sensor = false;
  std::size_t components = 1;
};

struct ChannelComponent {
  std::size_t channel = 0;  // index of the given channels
  std::size_t component = 0;
};

// Resolves "name", and of a channel with several components "name[k]", with three also "name.r", ".g" and
// ".b". Returns "" or an error message.
std::string resolve_channel(std::span<const NamedChannel>, bool is_sensor, std::string_view name,
                            ChannelComponent&);

// True if a channel, or a component of one, has this name.
bool has_channel(std::span<const NamedChannel>, std::string_view name);

}  // namespace apron::library
