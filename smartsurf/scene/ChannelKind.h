// The kinds of channels of a surface's cells, and the names by which one is chosen among all of them, as in
// --cells: "height", NAME of a sensor's, "command: NAME" of an actuator's, "apron:NAME" of a register.
#pragma once

#include <string>
#include <string_view>

namespace smartsurf::scene {

enum class ChannelKind { kHeight, kSensor, kCommand, kRegister };  // kRegister: of the APRON program

inline constexpr std::string_view prefix_of(ChannelKind kind) {
  return kind == ChannelKind::kCommand ? "command: " : kind == ChannelKind::kRegister ? "apron:" : "";
}

inline std::string full_name(ChannelKind kind, std::string_view name) {
  return std::string(prefix_of(kind)).append(name);
}

struct ChannelReference {
  ChannelKind kind;
  std::string_view name;  // within its kind
};

inline constexpr ChannelReference parse_channel(std::string_view full_name) {
  for (const ChannelKind kind : {ChannelKind::kCommand, ChannelKind::kRegister})
    if (full_name.starts_with(prefix_of(kind))) return {kind, full_name.substr(prefix_of(kind).size())};
  return {full_name == "height" ? ChannelKind::kHeight : ChannelKind::kSensor, full_name};
}

}  // namespace smartsurf::scene
