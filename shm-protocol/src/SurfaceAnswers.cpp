// How a surface receives answers: complete frames, or chunk by chunk while they are written.
#include "SurfaceImpl.h"
#include "shm-protocol/src/ring/FrameCopy.h"

namespace shm_protocol {

// Copies the arrays within [from, to) of that frame's slot.
void SurfaceEndpoint::Impl::copy_arrays(std::uint32_t frame_number, std::size_t from,
                                        std::size_t to) noexcept {
  if (answers_in_place) return;
  for (const auto& c : layout.channels) {
    if (c.direction != SSP_ACTUATOR) continue;
    intersect_channel(c, from, to, [&](std::size_t at, std::size_t bytes) {
      const std::byte* const cells = actuators.array(frame_number, c).data() + at;
      replaced += copy_sanitized(frames[1 - current].array(c) + at, cells, bytes, c);
    });
  }
}

void SurfaceEndpoint::Impl::copy_all(std::uint32_t frame_number) noexcept {
  replaced = 0;
  copy_arrays(frame_number, sizeof(ssp_slot), layout.geometry.actuator_slot_bytes);
}

// Copies at most one chunk of the uncopied bytes before `end` of that frame's slot; `attached` identifies the
// writer. Returns whether there were any.
bool SurfaceEndpoint::Impl::copy_chunk(std::uint32_t frame_number, std::uint32_t attached,
                                       std::size_t end) noexcept {
  return chunk_reader.copy_available(frame_number, attached, end, [&](std::size_t from, std::size_t to) {
    if (from == sizeof(ssp_slot)) replaced = 0;
    copy_arrays(frame_number, from, to);
  });
}

void SurfaceEndpoint::Impl::accept_frame(const FrameInfo& taken) noexcept {
  if (!answers_in_place) current = 1 - current;
  current_in_place = answers_in_place;
  info = taken;
  if (replaced != 0) count_clamped(replaced);
}

void SurfaceEndpoint::Impl::count_clamped(std::uint64_t values) noexcept {
  counters.clamped += values;
  store_relaxed(header.surface.clamped, counters.clamped);
}

// Compares `answers` and `frame`: a controller that answered abandoned frames may be writing the publication
// line of its next answer, which then does not belong to the word's frame.
bool SurfaceEndpoint::Impl::is_answer(std::uint32_t newest) const noexcept {
  return newest != last_word && load_acquire(header.actuators.answers) == frame &&
         static_cast<std::uint32_t>(load_relaxed(header.actuators.frame)) == newest;
}

// Time-step: the controller may not modify the frame before it sees the next sensor frame, so an unchanged
// word proves that it is complete. The slot's own metadata identifies it as the answer.
Status SurfaceEndpoint::Impl::take_answer(std::uint32_t newest) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);
  const bool inconsistent = !cursor.is_consistent_with(newest, attached);
  cursor.reset();
  if (inconsistent) return Status::kTorn;
  last_word = newest;
  const std::size_t resume_at = chunk_reader.finish(newest, attached);
  if (resume_at == sizeof(ssp_slot)) replaced = 0;
  copy_arrays(newest, resume_at, layout.geometry.actuator_slot_bytes);
  const FrameInfo taken = actuators.read_info(newest);
  fence_acquire();
  if (load_relaxed(header.actuators.word) != newest || taken.frame == 0 || taken.answers != frame)
    return Status::kTorn;
  accept_frame(taken);
  writer.on_answered();
  return Status::kOk;
}

Status SurfaceEndpoint::Impl::await_actuators(std::uint64_t at_tick, const WaitOptions& options) noexcept {
  if (description.mode != Mode::kTimeStep || frame == 0 || at_tick != tick) return Status::kOutOfTurn;
  if (answered) return Status::kOk;
  std::uint32_t newest = last_word;
  const auto ready = [&]() noexcept {
    newest = load_acquire(header.actuators.word);
    if (is_answer(newest)) return true;
    if (chunked) copy_committed(newest + 1);
    return false;
  };
  const Doorbell bell{header.actuators.word, header.surface_waiting.flag, header.actuators.cpu};
  Status status = wait_until(bell, options, wait_state, ready,
                             [&](bool check_liveness) noexcept { return controller_status(check_liveness); });
  if (status == Status::kOk) status = take_answer(newest);
  answered = status == Status::kOk;
  if (answered && controller == 0) unknown_answered = true;
  if (answered || status == Status::kNoController || status == Status::kControllerDead ||
      status == Status::kControllerClosed) {
    may_publish = true;
    cursor.reset();
  }
  return status;
}

// Copies a chunk of a frame that the controller is still writing.
void SurfaceEndpoint::Impl::copy_committed(std::uint32_t frame_number) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);  // before the progress line
  const std::size_t end =
      committed_bytes(header.actuator_progress, frame_number, layout.geometry.actuator_slot_bytes);
  if (end > 0 && copy_chunk(frame_number, attached, end)) ++wait_state.chunks;
}

// Delivers the available part of the answer being written, or of the one just published. Returns true if
// there was any, or if the cells delivered before belong to another frame.
bool SurfaceEndpoint::Impl::try_next_cells(int channel_index, const ssp_channel& c,
                                           std::span<const std::byte>& cells) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);  // before the progress line
  const std::uint32_t newest = load_acquire(header.actuators.word);
  const bool whole = !answered && is_answer(newest);
  const std::uint32_t frame_number = whole ? newest : newest + 1;
  if (!cursor.is_consistent_with(frame_number, attached)) return true;
  const std::size_t slot_bytes = layout.geometry.actuator_slot_bytes;
  const std::size_t end =
      whole ? slot_bytes : committed_bytes(header.actuator_progress, frame_number, slot_bytes);
  if (end == 0) return false;
  copy_chunk(frame_number, attached, end);
  cells = cursor.next(frame_number, attached, channel_index, c, chunk_reader.copied(),
                      incoming_cells(frame_number, c));
  return !cells.empty();
}

std::span<const std::byte> SurfaceEndpoint::Impl::next_cells(int channel_index, const ssp_channel& c,
                                                             const WaitOptions& options) noexcept {
  if (description.mode != Mode::kTimeStep || cursor.is_exhausted(channel_index, c)) return {};
  std::span<const std::byte> cells;
  if (may_publish) {  // no answer is due yet
    try_next_cells(channel_index, c, cells);
    return cells;
  }
  const auto ready = [&]() noexcept { return try_next_cells(channel_index, c, cells); };
  // Only checks; await_actuators() reports the loss of a controller.
  const auto peer = [&](bool check_liveness) noexcept {
    const ProcessIdentity now = load_acquire(header.claim.controller_process);
    return now == 0 || (check_liveness && !segment.liveness().is_alive(Side::kController, now))
               ? Status::kNoController
               : Status::kOk;
  };
  const Doorbell bell{header.actuators.word, header.surface_waiting.flag, header.actuators.cpu};
  (void)wait_until(bell, options, cursor.has_started() ? next_chunk_wait_state : wait_state, ready, peer);
  return cells;
}

Status SurfaceEndpoint::Impl::latest_actuators() noexcept {
  const Status peer = controller_status(wait_state.liveness.due());
  if (peer != Status::kOk) {
    last_word = load_acquire(header.actuators.word);  // discards unread frames of a lost controller
    return peer;
  }
  for (int attempt = 0; attempt < 3; ++attempt) {
    const std::uint32_t newest = load_acquire(header.actuators.word);
    if (newest == last_word) {
      store_relaxed(header.surface.repeated, ++counters.repeated);
      return Status::kRepeated;
    }
    const FrameInfo taken = actuators.read_info(newest);
    if (taken.frame == 0) continue;
    copy_all(newest);
    if (!actuators.is_still_valid(taken)) continue;
    counters.skipped += newest - last_word - 1;
    store_relaxed(header.surface.skipped, counters.skipped);
    last_word = newest;
    accept_frame(taken);
    return Status::kOk;
  }
  return Status::kTorn;
}

}  // namespace shm_protocol
