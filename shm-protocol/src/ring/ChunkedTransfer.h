// Large frames in chunks: the writer publishes its progress, and a reader may take committed chunks while the
// rest is being written. Optional: a reader that ignores the progress line finds the complete frame once it
// is published. Chunks taken early are valid only once the frame is complete.
//
// The progress word: the frame's low 24 bits << 40 | number of committed bytes from the start of the slot.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "FrameCopy.h"
#include "StorePolicy.h"
#include "shm-protocol/src/wait/Atomics.h"
#include "shm-protocol/src/wait/FutexWait.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

// Smallest write for which non-temporal stores are considered.
constexpr std::size_t kMinNonTemporalBytes = 4 * 1024;
constexpr std::size_t kMinChunkBytes = 8 * 1024, kMaxChunkBytes = 64 * 1024;

// The announced progress of a very large frame lags behind its writer: data just written is still in the
// writer's private cache, from which another core reads more slowly than from a shared one.
constexpr std::size_t kMinLaggedFrameBytes = 2 * 1024 * 1024, kProgressLagBytes = 256 * 1024;

// Smallest frame, in array bytes, for which reading along pays off.
constexpr std::size_t kMinChunkedFrameBytes = 2 * kMinChunkBytes;

constexpr std::uint64_t encode_progress(std::uint64_t frame, std::uint64_t bytes) noexcept {
  return (frame & 0xFFFFFF) << 40 | bytes;
}

// Returns the number of final bytes of `frame`, from the start of its slot, rounded down to 64 so that no
// element is split. The word is untrusted: the result is clamped to the slot.
inline std::size_t committed_bytes(const ssp_progress& line, std::uint32_t frame,
                                   std::size_t slot_bytes) noexcept {
  const std::uint64_t word = load_acquire(line.ready);
  if (word >> 40 != (frame & 0xFFFFFF)) return 0;
  return std::min<std::uint64_t>(word & ((std::uint64_t{1} << 40) - 1), slot_bytes) / 64 * 64;
}

class ChunkWriter {
 public:
  // `word` is the direction's publication word, on which a reader sleeps while `reader_waiting` is set.
  ChunkWriter(ssp_progress& line, const std::uint32_t& word, const std::uint32_t& reader_waiting,
              std::size_t array_bytes)
      : line_(line),
        word_(word),
        reader_waiting_(reader_waiting),
        arrays_end_(sizeof(ssp_slot) + array_bytes),
        chunk_bytes_(std::clamp(array_bytes / 2 / 64 * 64, kMinChunkBytes, kMaxChunkBytes)),
        lag_(array_bytes >= kMinLaggedFrameBytes ? kProgressLagBytes : 0) {}

  // Copies `values` to byte `at` of the channel's array in `slot`, which holds `frame`.
  void write(std::byte* slot, std::uint64_t frame, const ssp_channel& c, std::size_t at,
             std::span<const std::byte> values, bool reader_on_other_core) noexcept {
    const bool non_temporal = begin_chunk(frame, values.size(), reader_on_other_core);
    const std::size_t first = c.offset + at;
    for (std::size_t done = 0; done < values.size(); done += chunk_bytes_) {
      const std::size_t bytes = std::min(chunk_bytes_, values.size() - done);
      stream_frame(slot + first + done, values.data() + done, bytes, non_temporal);
      advance_committed(first + done, bytes);
    }
  }

  // Returns whether a reader may have taken chunks of that frame.
  bool has_announced(std::uint64_t frame) const noexcept { return announced_ == frame; }

  // Must be called before `frame` is published. Clears stale progress, which could otherwise match a later
  // frame with the same low 24 bits.
  void finish_frame(std::uint64_t frame) noexcept {
    if (announced_ == frame || announced_ == 0) return;
    announced_ = 0;
    store_release(line_.ready, 0);
  }

  // The peer answered the last published frame.
  void on_answered() noexcept { store_policy_.end_frame(); }

 private:
  // Returns whether to write `bytes` of `frame` with non-temporal stores.
  bool begin_chunk(std::uint64_t frame, std::size_t bytes, bool reader_on_other_core) noexcept {
    if (frame != frame_) {
      frame_ = frame;
      committed_end_ = sizeof(ssp_slot);
    }
    reader_on_other_core_ = reader_on_other_core;
    non_temporal_ = false;
    if (!reader_on_other_core || bytes < kMinNonTemporalBytes) return false;
    store_policy_.begin_frame();
    return non_temporal_ = store_policy_.use_non_temporal();
  }

  // Marks [first, first + bytes) of the slot as final. Ignored if it leaves a gap behind the committed part;
  // up to 63 bytes of padding between arrays are no gap.
  void advance_committed(std::size_t first, std::size_t bytes) noexcept {
    if (first > committed_end_ + SSP_ARRAY_ALIGNMENT - 1) return;
    committed_end_ = std::max(committed_end_, first + bytes);
    const std::size_t announced_end = committed_end_ - std::min(committed_end_, non_temporal_ ? 0 : lag_);
    if (announced_end >= sizeof(ssp_slot) + kMinChunkBytes && committed_end_ + SSP_LINE <= arrays_end_)
      announce_progress(announced_end);
  }

  // Wakes a sleeper on another core, which takes the chunk and keeps spinning. A sleeper on this core is not
  // woken, because it would preempt the writer. The end of the frame is not announced: publication follows.
  void announce_progress(std::size_t announced_end) noexcept {
    announced_ = frame_;
    store_seq_cst(line_.ready, encode_progress(frame_, announced_end));
    if (reader_on_other_core_ && load_seq_cst(reader_waiting_)) futex_wake(word_);
  }

  ssp_progress& line_;
  const std::uint32_t& word_;
  const std::uint32_t& reader_waiting_;
  std::size_t arrays_end_;   // end of the slot's arrays
  std::size_t chunk_bytes_;  // bytes per announcement
  std::size_t lag_;
  std::uint64_t frame_ = 0;
  std::size_t committed_end_ = 0;  // the slot's bytes before this offset are final
  std::uint64_t announced_ = 0;    // the frame on the progress line; 0: none
  StorePolicy store_policy_;
  bool reader_on_other_core_ = false, non_temporal_ = false;  // for the last chunk written
};

// Tracks how much of the next frame a reader has copied. `writer` distinguishes two writers of the same frame
// number.
class ChunkReader {
 public:
  // Calls copy(from, to), offsets in the slot, for at most one chunk of the uncopied bytes before `end`.
  // Returns whether there were any.
  template <class Copy>
  bool copy_available(std::uint32_t frame, std::uint32_t writer, std::size_t end, Copy&& copy) noexcept {
    if (frame_ != frame || writer_ != writer) reset(frame, writer);
    if (end <= copied_) return false;
    const std::size_t to = std::min(end, copied_ + kMaxChunkBytes);
    copy(copied_, to);
    copied_ = to;
    return true;
  }
  std::size_t copied() const noexcept { return copied_; }

  // Returns the offset of the first uncopied byte of `frame` by `writer`, and resets the state.
  std::size_t finish(std::uint32_t frame, std::uint32_t writer) noexcept {
    const std::size_t from = frame_ == frame && writer_ == writer ? copied_ : sizeof(ssp_slot);
    reset(0, 0);
    return from;
  }

 private:
  void reset(std::uint32_t frame, std::uint32_t writer) noexcept {
    frame_ = frame;
    writer_ = writer;
    copied_ = sizeof(ssp_slot);
  }

  std::uint32_t frame_ = 0, writer_ = 0;
  std::size_t copied_ = sizeof(ssp_slot);
};

// Tracks, per channel, how much of the next frame the user of an endpoint has received.
class ChunkCursor {
 public:
  // Returns whether everything delivered so far belongs to that frame of that writer.
  bool is_consistent_with(std::uint32_t frame, std::uint32_t writer) const noexcept {
    return !started_ || (frame_ == frame && writer_ == writer);
  }
  bool has_started() const noexcept { return started_; }
  bool is_exhausted(int channel_index, const ssp_channel& c) const noexcept {
    return started_ && delivered_[channel_index] == c.bytes;
  }
  void reset() noexcept {
    if (started_) delivered_.fill(0);
    started_ = false;
  }

  // Returns at most one chunk of `array`: bytes before offset `end` of the slot that were not delivered yet.
  std::span<const std::byte> next(std::uint32_t frame, std::uint32_t writer, int channel_index,
                                  const ssp_channel& c, std::size_t end,
                                  std::span<const std::byte> array) noexcept {
    std::size_t& delivered = delivered_[channel_index];
    const std::size_t available =
        std::min<std::size_t>(std::max<std::size_t>(end, c.offset) - c.offset, c.bytes);
    if (available <= delivered) return {};
    const auto chunk = array.subspan(delivered, std::min(available - delivered, kMaxChunkBytes));
    delivered += chunk.size();
    started_ = true;
    frame_ = frame;
    writer_ = writer;
    return chunk;
  }

 private:
  bool started_ = false;
  std::uint32_t frame_ = 0, writer_ = 0;
  std::array<std::size_t, SSP_MAX_CHANNELS> delivered_{};  // bytes
};

// Calls visit(offset in the array, bytes) for the part of the channel's array within [from, to) of the slot.
template <class Part>
void intersect_channel(const ssp_channel& c, std::size_t from, std::size_t to, Part&& visit) noexcept {
  const std::size_t begin = std::max<std::size_t>(from, c.offset);
  const std::size_t end = std::min<std::size_t>(to, c.offset + c.bytes);
  if (begin < end) visit(begin - c.offset, end - begin);
}

}  // namespace shm_protocol
