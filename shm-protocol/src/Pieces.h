// Large frames piece by piece: the writer streams its arrays past the caches and says how far it is; a reader
// that copies anyway copies along, instead of beginning when all is there. Nothing depends on it: a reader
// that never looks at the progress line finds the whole frame when it is announced.
//
// The progress word: the frame's low 24 bits << 40 | bytes from the slot's beginning that are final.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "FrameCopy.h"
#include "Waiting.h"
#include "Words.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

constexpr std::size_t kLargeFrame = 64 * 1024;  // array bytes from which progress is worth looking at
constexpr std::size_t kStreamed = 16 * 1024;    // bytes of a write from which it goes past the caches
constexpr std::size_t kPiece = 128 * 1024;      // is announced

constexpr std::uint64_t progress_word(std::uint64_t frame, std::uint64_t bytes) noexcept {
  return (frame & 0xFFFFFF) << 40 | bytes;
}

class PieceWriter {
 public:
  // `word` is the direction's publication word, on which a reader sleeps while `reader_waiting` is set.
  PieceWriter(ssp_progress& line, const std::uint32_t& word, const std::uint32_t& reader_waiting)
      : line_(line), word_(word), reader_waiting_(reader_waiting) {}

  // Copies `values` to byte `at` of the channel's array in `slot`, which holds `frame`.
  void write(std::byte* slot, std::uint64_t frame, const ssp_channel& c, std::size_t at,
             std::span<const std::byte> values, bool past_caches) noexcept {
    if (frame != frame_) frame_ = frame, end_ = sizeof(ssp_slot);
    const std::size_t begin = c.offset + at;
    for (std::size_t done = 0; done < values.size(); done += kPiece) {
      const std::size_t bytes = std::min(kPiece, values.size() - done);
      stream_frame(slot + begin + done, values.data() + done, bytes, past_caches);
      // Only what lies without a gap behind what was final before; up to 63 bytes between arrays are padding.
      if (begin + done > end_ + SSP_ARRAY_ALIGNMENT - 1) continue;
      end_ = std::max(end_, begin + done + bytes);
      if (end_ < kLargeFrame) continue;
      store_sequential(line_.ready, progress_word(frame, end_));
      if (load_sequential(reader_waiting_))
        futex_wake(word_);  // it wakes, copies what is there, and spins on
    }
  }

 private:
  ssp_progress& line_;
  const std::uint32_t& word_;
  const std::uint32_t& reader_waiting_;
  std::uint64_t frame_ = 0;
  std::size_t end_ = 0;  // the slot's bytes up to here are final
};

// What a reader has copied of the frame to come.
class PieceReader {
 public:
  explicit PieceReader(const ssp_progress& line) : line_(line) {}

  // Calls copy(from, to), byte positions in the slot, for what has become final of `frame` since the last
  // call. `writer` tells two writers of one frame number apart.
  template <class Copy>
  void look(std::uint32_t frame, std::uint32_t writer, std::size_t slot_bytes, Copy&& copy) noexcept {
    const std::uint64_t word = load_acquire(line_.ready);
    if (word >> 40 != (frame & 0xFFFFFF)) return;
    // Whole lines: an element is never split. The writer may claim anything; no more than the slot is
    // believed.
    const std::size_t end =
        std::min<std::uint64_t>(word & ((std::uint64_t{1} << 40) - 1), slot_bytes) / 64 * 64;
    if (frame_ != frame || writer_ != writer) restart(frame, writer);
    if (end <= copied_) return;
    const std::size_t to = std::min(end, copied_ + kPiece);  // and then look at the word again
    copy(copied_, to);
    copied_ = to;
  }

  // From where on `frame` of `writer` is still to be copied; forgets it.
  std::size_t finish(std::uint32_t frame, std::uint32_t writer) noexcept {
    const std::size_t from = frame_ == frame && writer_ == writer ? copied_ : sizeof(ssp_slot);
    restart(0, 0);
    return from;
  }

 private:
  void restart(std::uint32_t frame, std::uint32_t writer) noexcept {
    frame_ = frame, writer_ = writer, copied_ = sizeof(ssp_slot);
  }

  const ssp_progress& line_;
  std::uint32_t frame_ = 0, writer_ = 0;
  std::size_t copied_ = sizeof(ssp_slot);
};

// The part of the channel's array that lies in [from, to) of the slot: calls part(byte in the array, bytes).
template <class Part>
void part_of(const ssp_channel& c, std::size_t from, std::size_t to, Part&& part) noexcept {
  const std::size_t begin = std::max<std::size_t>(from, c.offset);
  const std::size_t end = std::min<std::size_t>(to, c.offset + c.bytes);
  if (begin < end) part(begin - c.offset, end - begin);
}

}  // namespace shm_protocol
