#include "apron/library/ChannelName.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/text/Number.h"

namespace apron::library {
namespace {

// Parses "[k]", or ".r", ".g" and ".b" of a channel with three components.
bool parse_component(std::string_view suffix, std::size_t components, std::size_t& component) {
  constexpr std::string_view kColours = "rgb";
  if (suffix.size() == 2 && suffix[0] == '.' && components == 3) {
    component = kColours.find(suffix[1]);
    return component != std::string_view::npos;
  }
  if (suffix.size() < 3 || suffix.front() != '[' || suffix.back() != ']') return false;
  return common::parse_number(suffix.substr(1, suffix.size() - 2), component) && component < components;
}

std::string unknown_channel_message(std::span<const NamedChannel> channels, bool is_sensor,
                                    std::string_view name) {
  const std::string_view kind = is_sensor ? "sensor" : "actuator";
  std::string list;
  for (const NamedChannel& c : channels)
    if (c.is_sensor == is_sensor) list += (list.empty() ? "" : ", ") + c.name;
  return fmt::format("the surface has no {0} channel '{1}'; {2}", kind, name,
                     list.empty() ? fmt::format("it has no {} channels", kind)
                                  : fmt::format("its {} channels: {}", kind, list));
}

}  // namespace

std::string resolve_channel(std::span<const NamedChannel> channels, bool is_sensor, std::string_view name,
                            ChannelComponent& target) {
  const auto find = [&](std::string_view wanted) {
    return std::ranges::find_if(
        channels, [&](const NamedChannel& c) { return c.is_sensor == is_sensor && c.name == wanted; });
  };
  std::string_view channel = name, component;
  // A channel's own name may contain a dot, so the whole name is looked up before it is split.
  auto found = find(name);
  if (found == channels.end()) {
    const std::size_t bracket = name.find('[');
    const std::size_t suffix = std::min(bracket != name.npos ? bracket : name.rfind('.'), name.size());
    channel = name.substr(0, suffix);
    component = name.substr(suffix);
    found = find(channel);
  }
  if (found == channels.end()) return unknown_channel_message(channels, is_sensor, channel);
  target = {static_cast<std::size_t>(found - channels.begin()), 0};
  const std::size_t components = found->components;
  if (component.empty() ? components == 1 : parse_component(component, components, target.component))
    return {};
  return components == 1
             ? fmt::format("channel '{0}' has one component per cell, not '{1}': write '{0}'", channel, name)
             : fmt::format(
                   "channel '{0}' has {1} components per cell, not '{2}': write '{0}[0]' to '{0}[{3}]'",
                   channel, components, name, components - 1);
}

bool has_channel(std::span<const NamedChannel> channels, std::string_view name) {
  ChannelComponent unused;
  return std::ranges::find(channels, name, &NamedChannel::name) != channels.end() ||
         resolve_channel(channels, true, name, unused).empty() ||
         resolve_channel(channels, false, name, unused).empty();
}

}  // namespace apron::library
