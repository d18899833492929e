#include "Discovery.h"

#include <utility>

#include "shm-protocol/src/wait/Atomics.h"

namespace shm_protocol {

std::optional<FoundSurface> find_surface(const std::string& name, Access access, std::string& why) {
  auto segment = Segment::open(name, access);
  if (!segment) {
    why = "there is no surface \"" + name + "\" (no " + path_of(name) + ")";
    return std::nullopt;
  }
  auto layout = read_layout(segment->bytes(), path_of(name));
  if (!layout) {
    why = path_of(name) + " never became ready";
    return std::nullopt;
  }
  const ProcessIdentity surface = layout->identity.surface_process;
  if (!segment->liveness().is_alive(Side::kSurface, surface)) {
    why = "surface \"" + name + "\" is dead: process " + std::to_string(pid_of(surface)) +
          " is gone and left " + path_of(name);
    return std::nullopt;
  }
  const auto& header = *reinterpret_cast<const ssp_header*>(segment->bytes().data());
  if (load_acquire(header.surface.state) == SSP_STATE_CLOSING) {
    why = "surface \"" + name + "\" is closing";
    return std::nullopt;
  }
  return FoundSurface{std::move(*segment), std::move(*layout)};
}

}  // namespace shm_protocol
