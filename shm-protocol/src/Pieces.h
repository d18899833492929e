// Large frames piece by piece: the writer says how far it is, and a reader may take what is final while the
// rest is still being written. Nothing depends on it: a reader that never looks at the progress line finds
// the whole frame when it is announced, and what was taken early counts only once the frame is whole.
//
// The progress word: the frame's low 24 bits << 40 | bytes from the slot's beginning that are final.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "Arrays.h"
#include "FrameCopy.h"
#include "StoreChoice.h"
#include "Waiting.h"
#include "Words.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

constexpr std::size_t kStreamed =
    4 * 1024;  // bytes of a piece from which a way past the caches is considered
constexpr std::size_t kSmallestPiece = 8 * 1024, kLargestPiece = 64 * 1024;

// How far the announcements of a very large frame stay behind its writer: what it has just written still lies
// in its own cache, from where another core gets it more slowly than from one that they share.
constexpr std::size_t kVeryLarge = 2 * 1024 * 1024, kLag = 256 * 1024;

// Array bytes of a frame from which progress is worth looking at.
constexpr std::size_t kLargeFrame = 2 * kSmallestPiece;

constexpr std::uint64_t progress_word(std::uint64_t frame, std::uint64_t bytes) noexcept {
  return (frame & 0xFFFFFF) << 40 | bytes;
}

// How many bytes of `frame` are final, counted from its slot's beginning: whole lines, so that no element is
// split. The writer may claim anything; no more than the slot is believed.
inline std::size_t final_bytes(const ssp_progress& line, std::uint32_t frame,
                               std::size_t slot_bytes) noexcept {
  const std::uint64_t word = load_acquire(line.ready);
  if (word >> 40 != (frame & 0xFFFFFF)) return 0;
  return std::min<std::uint64_t>(word & ((std::uint64_t{1} << 40) - 1), slot_bytes) / 64 * 64;
}

class PieceWriter {
 public:
  // `word` is the direction's publication word, on which a reader sleeps while `reader_waiting` is set.
  PieceWriter(ssp_progress& line, const std::uint32_t& word, const std::uint32_t& reader_waiting,
              std::size_t array_bytes)
      : line_(line),
        word_(word),
        reader_waiting_(reader_waiting),
        last_(sizeof(ssp_slot) + array_bytes),
        piece_(std::clamp(array_bytes / 2 / 64 * 64, kSmallestPiece, kLargestPiece)),
        lag_(array_bytes >= kVeryLarge ? kLag : 0),
        staging_(std::min(array_bytes, kLargestPiece)) {}

  // Copies `values` to byte `at` of the channel's array in `slot`, which holds `frame`.
  void write(std::byte* slot, std::uint64_t frame, const ssp_channel& c, std::size_t at,
             std::span<const std::byte> values, bool reader_is_elsewhere) noexcept {
    const bool past_caches = begin(frame, values.size(), reader_is_elsewhere);
    const std::size_t first = c.offset + at;
    for (std::size_t done = 0; done < values.size(); done += piece_) {
      const std::size_t bytes = std::min(piece_, values.size() - done);
      stream_frame(slot + first + done, values.data() + done, bytes, past_caches);
      advance(first + done, bytes);
    }
  }

  // Where to make `bytes` of the array from byte `at` on, a piece at most: in the slot itself or, where it is
  // better written past the caches, beside it. commit() makes them final.
  std::span<std::byte> reserve(std::byte* slot, std::uint64_t frame, const ssp_channel& c, std::size_t at,
                               std::size_t bytes, bool reader_is_elsewhere) noexcept {
    bytes = std::min(bytes, kLargestPiece);
    staged_ = begin(frame, bytes, reader_is_elsewhere);
    slot_ = slot;
    reserved_first_ = c.offset + at, reserved_bytes_ = bytes;
    return {staged_ ? staging_.begin() : slot + reserved_first_, bytes};
  }
  void commit() noexcept {
    if (reserved_bytes_ == 0) return;
    if (staged_) stream_frame(slot_ + reserved_first_, staging_.begin(), reserved_bytes_, true);
    advance(reserved_first_, reserved_bytes_);
    reserved_bytes_ = 0;
  }

  // Whether a reader may have taken pieces of that frame.
  bool has_announced(std::uint64_t frame) const noexcept { return announced_ == frame; }

  // To be called before `frame` is published: nothing may be left that could be taken for a later frame of
  // the same 24 bits.
  void finish(std::uint64_t frame) noexcept {
    if (frame == frame_) commit();  // what was reserved last, should that have been forgotten
    if (announced_ == frame || announced_ == 0) return;
    announced_ = 0;
    store_release(line_.ready, 0);
  }

  // The peer answered the frame published last.
  void answered() noexcept { choice_.end(); }

 private:
  // Returns whether so many bytes of `frame` go past the caches.
  bool begin(std::uint64_t frame, std::size_t bytes, bool reader_is_elsewhere) noexcept {
    if (frame != frame_) frame_ = frame, end_ = sizeof(ssp_slot);
    reader_is_elsewhere_ = reader_is_elsewhere;
    past_caches_ = false;
    if (!reader_is_elsewhere || bytes < kStreamed) return false;
    choice_.begin();
    return past_caches_ = choice_.past_caches();
  }

  // The slot's bytes from `first` on are final: they count only without a gap behind what was final before;
  // up to 63 bytes between arrays are padding.
  void advance(std::size_t first, std::size_t bytes) noexcept {
    if (first > end_ + SSP_ARRAY_ALIGNMENT - 1) return;
    end_ = std::max(end_, first + bytes);
    const std::size_t final_end = end_ - std::min(end_, past_caches_ ? 0 : lag_);
    if (final_end >= sizeof(ssp_slot) + kSmallestPiece && end_ + SSP_LINE <= last_) announce(final_end);
  }

  // The end of the frame needs no announcement of its own: it is published next. A sleeper elsewhere wakes,
  // takes what is there, and spins on; one on this core would only take it away.
  void announce(std::size_t final_end) noexcept {
    announced_ = frame_;
    store_sequential(line_.ready, progress_word(frame_, final_end));
    if (reader_is_elsewhere_ && load_sequential(reader_waiting_)) futex_wake(word_);
  }

  ssp_progress& line_;
  const std::uint32_t& word_;
  const std::uint32_t& reader_waiting_;
  std::size_t last_;   // where the slot's arrays end
  std::size_t piece_;  // bytes announced at once
  std::size_t lag_;
  std::uint64_t frame_ = 0;
  std::size_t end_ = 0;          // the slot's bytes up to here are final
  std::uint64_t announced_ = 0;  // the frame that the progress line speaks of
  StoreChoice choice_;
  bool reader_is_elsewhere_ = false, past_caches_ = false;  // of the piece written last

  Arrays staging_;  // of one piece
  bool staged_ = false;
  std::byte* slot_ = nullptr;  // where that piece belongs
  std::size_t reserved_first_ = 0, reserved_bytes_ = 0;
};

// What a reader has copied of the frame to come. `writer` tells two writers of one frame number apart.
class PieceReader {
 public:
  // Calls copy(from, to), byte positions in the slot, for what lies below `end` and was not copied yet, a
  // piece at most. True: there was some.
  template <class Copy>
  bool follow(std::uint32_t frame, std::uint32_t writer, std::size_t end, Copy&& copy) noexcept {
    if (frame_ != frame || writer_ != writer) restart(frame, writer);
    if (end <= copied_) return false;
    const std::size_t to = std::min(end, copied_ + kLargestPiece);  // and then look again
    copy(copied_, to);
    copied_ = to;
    return true;
  }
  std::size_t copied() const noexcept { return copied_; }

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

  std::uint32_t frame_ = 0, writer_ = 0;
  std::size_t copied_ = sizeof(ssp_slot);
};

// What the user of an endpoint was given of the frame to come, channel by channel.
class Handout {
 public:
  // Whether all that was given, if anything was, is of that frame of that writer.
  bool fits(std::uint32_t frame, std::uint32_t writer) const noexcept {
    return !begun_ || (frame_ == frame && writer_ == writer);
  }
  bool has_begun() const noexcept { return begun_; }
  bool is_over(int number, const ssp_channel& c) const noexcept {
    return begun_ && given_[static_cast<std::size_t>(number)] == c.bytes;
  }
  void restart() noexcept {
    if (begun_) given_.fill(0);
    begun_ = false;
  }

  // The part of `array` that lies below `end` of the slot and was not given yet, a piece at most.
  std::span<const std::byte> next(std::uint32_t frame, std::uint32_t writer, int number, const ssp_channel& c,
                                  std::size_t end, std::span<const std::byte> array) noexcept {
    std::size_t& given = given_[static_cast<std::size_t>(number)];
    const std::size_t there = std::min<std::size_t>(std::max<std::size_t>(end, c.offset) - c.offset, c.bytes);
    if (there <= given) return {};
    const auto part = array.subspan(given, std::min(there - given, kLargestPiece));
    given += part.size();
    begun_ = true, frame_ = frame, writer_ = writer;
    return part;
  }

 private:
  bool begun_ = false;
  std::uint32_t frame_ = 0, writer_ = 0;
  std::array<std::size_t, SSP_MAX_CHANNELS> given_{};  // bytes
};

// The part of the channel's array that lies in [from, to) of the slot: calls part(byte in the array, bytes).
template <class Part>
void part_of(const ssp_channel& c, std::size_t from, std::size_t to, Part&& part) noexcept {
  const std::size_t begin = std::max<std::size_t>(from, c.offset);
  const std::size_t end = std::min<std::size_t>(to, c.offset + c.bytes);
  if (begin < end) part(begin - c.offset, end - begin);
}

}  // namespace shm_protocol
