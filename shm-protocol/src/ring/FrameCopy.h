// Copies frames out of slots that their writer may change concurrently, and validates the values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shm_protocol/layout.h"

namespace shm_protocol {

// Copies each byte once. The copy may be torn; whoever calls finds that out from the slot's sequence
// afterwards.
void copy_frame(std::byte* to, const std::byte* from, std::size_t bytes) noexcept;

// Copies into a slot; past_caches: with stores that leave the writer's caches alone, so that the reader's
// core gets the lines from memory instead of asking this core for each. Complete for whoever sees a later
// release store.
void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool non_temporal) noexcept;

// Copies `bytes` of an actuator array, whole elements, and makes them safe: an f32 NaN becomes the channel's
// safe value, ±infinity and whatever else is out of range becomes the nearer end of the range. Returns how
// many values it replaced. The values are looked at only after they are private, so that what was checked
// cannot change any more.
std::uint64_t copy_sanitized(std::byte* to, const std::byte* from, std::size_t bytes,
                             const ssp_channel&) noexcept;

}  // namespace shm_protocol
