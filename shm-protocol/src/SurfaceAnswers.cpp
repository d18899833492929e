// How a surface takes answers in: whole frames, or piece by piece as they are written.
#include "FrameCopy.h"
#include "SurfaceImpl.h"

namespace shm_protocol {

// Bytes `from` to `to` of that frame's slot.
void SurfaceEndpoint::Impl::copy_arrays(std::uint32_t of, std::size_t from, std::size_t to) noexcept {
  for (const auto& c : geometry.channels) {
    if (c.direction != SSP_ACTUATOR) continue;
    part_of(c, from, to, [&](std::size_t at, std::size_t bytes) {
      std::byte* const cells = actuators.array(of, c).data() + at;
      replaced += in_place ? check_in_place(cells, bytes, c)
                           : copy_checked(frames[1 - shown].array(c) + at, cells, bytes, c);
    });
  }
}

void SurfaceEndpoint::Impl::copy_all(std::uint32_t of) noexcept {
  replaced = 0;
  copy_arrays(of, sizeof(ssp_slot), geometry.geometry.actuator_slot_bytes);
}

// A piece of what lies below `end` of that frame's slot; `attached` tells whose frame it is. True: there was
// one.
bool SurfaceEndpoint::Impl::copy_piece(std::uint32_t of, std::uint32_t attached, std::size_t end) noexcept {
  return pieces.follow(of, attached, end, [&](std::size_t from, std::size_t to) {
    if (from == sizeof(ssp_slot)) replaced = 0;
    copy_arrays(of, from, to);
  });
}

void SurfaceEndpoint::Impl::accept(const FrameInfo& taken) noexcept {
  if (!in_place) shown = 1 - shown;
  shown_in_place = in_place;
  info = taken;
  if (replaced == 0) return;
  counters.clamped += replaced;
  store_relaxed(header.surface.clamped, counters.clamped);
}

// A controller that answered frames which this surface gave up meanwhile may just be announcing the next
// answer: then the line is not of the word's frame.
bool SurfaceEndpoint::Impl::is_answer(std::uint32_t newest) const noexcept {
  return newest != word && load_acquire(header.actuators.answers) == frame &&
         static_cast<std::uint32_t>(load_relaxed(header.actuators.frame)) == newest;
}

// Time-step: the controller may not touch the frame before it sees the next sensor frame, so an unchanged
// word is proof enough that it is whole; that it is the answer, its own stamp says.
Status SurfaceEndpoint::Impl::take_in(std::uint32_t from) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);
  const bool in_pieces = !handout.fits(from, attached);
  handout.restart();
  if (in_pieces) return Status::kTorn;
  word = from;
  const std::size_t rest = pieces.finish(from, attached);
  if (rest == sizeof(ssp_slot)) replaced = 0;
  copy_arrays(from, rest, geometry.geometry.actuator_slot_bytes);
  const FrameInfo taken = actuators.stamp(from);
  fence_acquire();
  if (load_relaxed(header.actuators.word) != from || taken.frame == 0 || taken.answers != frame)
    return Status::kTorn;
  accept(taken);
  writer.answered();
  return Status::kOk;
}

Status SurfaceEndpoint::Impl::await_actuators(std::uint64_t at_tick, const WaitOptions& options) noexcept {
  if (description.mode != Mode::kTimeStep || frame == 0 || at_tick != tick) return Status::kOutOfTurn;
  if (answered) return Status::kOk;
  std::uint32_t newest = word;
  const auto ready = [&]() noexcept {
    newest = load_acquire(header.actuators.word);
    if (is_answer(newest)) return true;
    if (large) copy_along(newest + 1);
    return false;
  };
  const Doorbell bell{header.actuators.word, header.surface_waiting.flag, header.actuators.cpu};
  Status status = wait_until(bell, options, patience, ready,
                             [&](bool look_up) noexcept { return controller_status(look_up); });
  if (status == Status::kOk) status = take_in(newest);
  answered = status == Status::kOk;
  if (answered && controller == 0) stranger_answered = true;
  if (answered || status == Status::kNoController || status == Status::kControllerDead ||
      status == Status::kControllerClosed) {
    settled = true;
    handout.restart();
  }
  return status;
}

// While the controller still writes that frame.
void SurfaceEndpoint::Impl::copy_along(std::uint32_t of) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);  // before the progress line
  const std::size_t end = final_bytes(header.actuator_progress, of, geometry.geometry.actuator_slot_bytes);
  if (end > 0 && copy_piece(of, attached, end)) ++patience.pieces;
}

// Hands out what is there of the answer to come, or of the one that has just come. True: there was some, or
// what was handed out before is of another frame.
bool SurfaceEndpoint::Impl::next_now(int number, const ssp_channel& c,
                                     std::span<const std::byte>& cells) noexcept {
  const std::uint32_t attached = load_acquire(header.claim.attached);  // before the progress line
  const std::uint32_t newest = load_acquire(header.actuators.word);
  const bool whole = !answered && is_answer(newest);
  const std::uint32_t of = whole ? newest : newest + 1;
  if (!handout.fits(of, attached)) return true;
  const std::size_t slot_bytes = geometry.geometry.actuator_slot_bytes;
  const std::size_t end = whole ? slot_bytes : final_bytes(header.actuator_progress, of, slot_bytes);
  if (end == 0) return false;
  copy_piece(of, attached, end);
  cells = handout.next(of, attached, number, c, pieces.copied(), next_shown_cells(of, c));
  return !cells.empty();
}

std::span<const std::byte> SurfaceEndpoint::Impl::next_cells(int number,
                                                             const WaitOptions& options) noexcept {
  const auto& c = geometry.channels[static_cast<std::size_t>(number)];
  if (description.mode != Mode::kTimeStep || handout.is_over(number, c)) return {};
  std::span<const std::byte> cells;
  if (settled) {  // nothing is owed yet
    next_now(number, c, cells);
    return cells;
  }
  const auto ready = [&]() noexcept { return next_now(number, c, cells); };
  // Only a look, and no loss is told of: await_actuators() will.
  const auto peer = [&](bool look_up) noexcept {
    const ProcessWord now = load_acquire(header.claim.controller_process);
    return now == 0 || (look_up && !is_alive(now)) ? Status::kNoController : Status::kOk;
  };
  const Doorbell bell{header.actuators.word, header.surface_waiting.flag, header.actuators.cpu};
  (void)wait_until(bell, options, handout.has_begun() ? patience_for_more : patience, ready, peer);
  return cells;
}

Status SurfaceEndpoint::Impl::latest_actuators() noexcept {
  const Status peer = controller_status(patience.liveness.due());
  if (peer != Status::kOk) {
    word =
        load_acquire(header.actuators.word);  // what a lost controller left unread is not acted upon any more
    return peer;
  }
  for (int attempt = 0; attempt < 3; ++attempt) {
    const std::uint32_t newest = load_acquire(header.actuators.word);
    if (newest == word) {
      store_relaxed(header.surface.repeated, ++counters.repeated);
      return Status::kRepeated;
    }
    const FrameInfo taken = actuators.stamp(newest);
    if (taken.frame == 0) continue;
    copy_all(newest);
    if (!actuators.still_whole(taken)) continue;
    counters.skipped += newest - word - 1;
    store_relaxed(header.surface.skipped, counters.skipped);
    word = newest;
    accept(taken);
    return Status::kOk;
  }
  return Status::kTorn;
}

}  // namespace shm_protocol
