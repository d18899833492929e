// The segment's header and channel directory: planned from a configuration, written once, validated on
// reading. Every size and offset is checked against the segment's actual size. Both sides keep a private copy
// and never read the shared one again, so that later changes by the peer have no effect.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "shm_protocol/Description.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

struct SegmentLayout {
  ssp_identity identity{};
  ssp_geometry geometry{};
  std::vector<ssp_channel> channels;

  std::size_t sensor_array_bytes() const noexcept;  // per slot, without the slot header
  std::size_t actuator_array_bytes() const noexcept;

  // Precondition: there is such a channel, of that direction and type.
  const ssp_channel& channel(int index, [[maybe_unused]] ssp_direction direction,
                             [[maybe_unused]] DType dtype) const noexcept {
    const ssp_channel& c = channels[index];
    assert(c.direction == direction && c.dtype == static_cast<std::uint32_t>(dtype));
    return c;
  }
};

// Throws Error(kBadConfig) that names the field, its value and the valid range.
void check_name(const std::string& name);
SegmentLayout plan_layout(const SurfaceConfig&);

// Writes header, directory, positions and slots into a zeroed segment, except the version word. Every
// actuator and sensor array is filled with its safe value.
void write_layout(const SegmentLayout&, const SurfaceConfig&, std::span<std::byte> segment);

// Returns the validated private copy; nothing while the segment is not ready. Throws Error: kForeign,
// kWrongVersion, kCorrupt; `origin` names the segment in the message.
std::optional<SegmentLayout> read_layout(std::span<const std::byte> segment, const std::string& origin);

Description describe(const SegmentLayout&, std::span<const std::byte> segment);

// The range of values that the dtype can represent.
std::pair<double, double> dtype_limits(DType) noexcept;
// Fills an array of the channel with its safe value.
void fill_safe(std::span<std::byte> array, const ssp_channel&) noexcept;

// FNV-1a over the geometry line and the directory.
std::uint64_t layout_hash(const ssp_geometry&, std::span<const std::byte> directory) noexcept;

}  // namespace shm_protocol
