// Copies frames out of slots that their writer may change concurrently, and validates the values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shm_protocol/layout.h"

namespace shm_protocol {

// Reads each byte once. The copy may be torn; the caller checks the slot's sequence afterwards.
void copy_frame(std::byte* to, const std::byte* from, std::size_t bytes) noexcept;

// Copies into a slot. With `non_temporal` the stores bypass the writer's caches, so that the reader's core
// loads the lines from memory instead of from this core. A later release store orders the copy.
void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool non_temporal) noexcept;

// Copies `bytes` (whole elements) of an actuator array and sanitizes them: an f32 NaN becomes the channel's
// safe value, all other values are clamped to the channel's range. Returns the number of replaced values.
// The check runs on the private copy, so that the peer cannot change a value after it was checked.
std::uint64_t copy_sanitized(std::byte* to, const std::byte* from, std::size_t bytes,
                             const ssp_channel&) noexcept;

}  // namespace shm_protocol
