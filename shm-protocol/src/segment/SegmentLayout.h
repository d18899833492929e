// The segment's header and directory: planned from a configuration, written once, and read back only after
// every size and offset was checked against the segment's real size. Both sides keep a private copy and never
// read the shared one again, so that a peer's later changes have no effect.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "shm_protocol/Description.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

struct SegmentLayout {
  ssp_identity identity{};
  ssp_geometry geometry{};
  std::vector<ssp_channel> channels;

  std::size_t sensor_array_bytes() const noexcept;  // of one slot, without its header
  std::size_t actuator_array_bytes() const noexcept;
};

// Throws Error(kBadConfig) naming the field, its value and what would be right.
void check_name(const std::string& name);
SegmentLayout plan_layout(const SurfaceConfig&);

// Lays header, directory, positions and slots into a zeroed segment, all but the version word; every actuator
// and sensor array is filled with its safe value.
void write_layout(const SegmentLayout&, const SurfaceConfig&, std::span<std::byte> segment);

// The checked private copy; nothing while the segment is not ready. Throws Error: kForeign, kWrongVersion,
// kCorrupt; `origin` names the segment in the message.
std::optional<SegmentLayout> read_layout(std::span<const std::byte> segment, const std::string& origin);

Description describe(const SegmentLayout&, std::span<const std::byte> segment);

// FNV-1a over the geometry line and the directory.
std::uint64_t layout_hash(const ssp_geometry&, std::span<const std::byte> directory) noexcept;

}  // namespace shm_protocol
