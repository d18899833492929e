// The ring of slots of one direction: locates frames and detects torn ones (seqlock).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shm-protocol/src/segment/SegmentLayout.h"
#include "shm-protocol/src/wait/Atomics.h"

namespace shm_protocol {

// Reader's view; works on a read-only mapping.
class RingView {
 public:
  RingView(const SegmentLayout& layout, ssp_direction direction, const std::byte* segment) {
    const ssp_geometry& g = layout.geometry;
    const bool sensor = direction == SSP_SENSOR;
    begin_ = segment + (sensor ? g.sensor_ring_offset : g.actuator_ring_offset);
    slot_bytes_ = sensor ? g.sensor_slot_bytes : g.actuator_slot_bytes;
    // In lock-step one frame is read while the next is written. Two slots suffice and keep large frames
    // cached.
    const bool lock_step = layout.identity.mode == SSP_MODE_TIME_STEP;
    mask_ = (lock_step ? SSP_TIME_STEP_SLOTS : sensor ? g.sensor_slots : g.actuator_slots) - 1;
  }

  // The low 32 bits of a frame number suffice, because only the low bits select the slot.
  const ssp_slot& slot(std::uint64_t frame) const noexcept {
    return *reinterpret_cast<const ssp_slot*>(begin_ + (frame & mask_) * slot_bytes_);
  }
  std::span<const std::byte> array(std::uint64_t frame, const ssp_channel& c) const noexcept {
    return {reinterpret_cast<const std::byte*>(&slot(frame)) + c.offset, static_cast<std::size_t>(c.bytes)};
  }

  std::uint64_t slot_count() const noexcept { return mask_ + 1; }

  // Returns the metadata of the frame whose low 32 bits are `word`; frame 0 if the slot holds another frame
  // or an incomplete one.
  FrameInfo read_info(std::uint32_t word) const noexcept {
    const ssp_slot& s = slot(word);
    const std::uint64_t sequence = load_acquire(s.sequence);
    FrameInfo info;
    if (sequence == 0 || sequence % 2 != 0 || static_cast<std::uint32_t>(sequence / 2) != word) return info;
    info = {sequence / 2, load_relaxed(s.tick), load_relaxed(s.time_s), load_relaxed(s.answers),
            load_relaxed(s.status)};
    return info;
  }

  // Returns whether the frame stayed complete since read_info() returned it. Call it after reading the
  // arrays.
  bool is_still_valid(const FrameInfo& info) const noexcept {
    // The array reads must not be reordered after this load.
    fence_acquire();
    return load_relaxed(slot(info.frame).sequence) == 2 * info.frame;
  }

 private:
  const std::byte* begin_;
  std::uint64_t mask_;
  std::uint64_t slot_bytes_;
};

class Ring : public RingView {
 public:
  Ring(const SegmentLayout& layout, ssp_direction direction, std::byte* segment)
      : RingView(layout, direction, segment) {}

  // The cast is valid because a Ring requires a writable mapping.
  ssp_slot& slot(std::uint64_t frame) const noexcept { return const_cast<ssp_slot&>(RingView::slot(frame)); }
  std::span<std::byte> array(std::uint64_t frame, const ssp_channel& c) const noexcept {
    return {reinterpret_cast<std::byte*>(&slot(frame)) + c.offset, static_cast<std::size_t>(c.bytes)};
  }

  // Marks the slot of `frame` as being written; the caller then fills its arrays.
  void begin_write(std::uint64_t frame) const noexcept {
    store_relaxed(slot(frame).sequence, 2 * frame - 1);
    // No array byte may become visible before the odd sequence: a reader that sees such a byte must also see
    // the sequence.
    fence_release();
  }

  // Marks the frame as complete.
  void end_write(const FrameInfo& info) const noexcept {
    ssp_slot& s = slot(info.frame);
    store_relaxed(s.frame, info.frame);
    store_relaxed(s.tick, info.tick);
    store_relaxed(s.time_s, info.time_s);
    store_relaxed(s.answers, info.answers);
    store_relaxed(s.status, info.status);
    store_release(s.sequence, 2 * info.frame);
  }
};

// Writes a complete frame's metadata to the direction's publication line; store_and_wake() with the frame's
// low 32 bits follows. `answers` is released last: a reader that sees it also sees the frame it belongs to.
inline void store_publication(ssp_publication& line, const FrameInfo& info, std::uint32_t cpu) noexcept {
  store_relaxed(line.cpu, cpu);
  store_relaxed(line.frame, info.frame);
  store_relaxed(line.tick, info.tick);
  store_relaxed(line.time_s, info.time_s);
  store_relaxed(line.status, info.status);
  store_release(line.answers, info.answers);
}

inline FrameInfo load_publication(const ssp_publication& line) noexcept {
  return {load_relaxed(line.frame), load_relaxed(line.tick), load_relaxed(line.time_s),
          load_relaxed(line.answers), load_relaxed(line.status)};
}

inline Counters load_counters(const ssp_side& side) noexcept {
  return {load_relaxed(side.skipped), load_relaxed(side.repeated), load_relaxed(side.clamped),
          load_relaxed(side.deadline_misses)};
}

}  // namespace shm_protocol
