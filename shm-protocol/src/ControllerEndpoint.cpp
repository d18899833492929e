#include "shm_protocol/ControllerEndpoint.h"

#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <thread>
#include <utility>

#include "shm-protocol/src/ring/ChunkedTransfer.h"
#include "shm-protocol/src/ring/FrameArrays.h"
#include "shm-protocol/src/ring/FrameCopy.h"
#include "shm-protocol/src/ring/Ring.h"
#include "shm-protocol/src/segment/Discovery.h"
#include "shm-protocol/src/segment/ProcessIdentity.h"
#include "shm-protocol/src/segment/Segment.h"
#include "shm-protocol/src/segment/SegmentLayout.h"
#include "shm-protocol/src/wait/FutexWait.h"

namespace shm_protocol {
struct ControllerEndpoint::Impl {
  Impl(Segment mapped, SegmentLayout checked_layout, ProcessIdentity self)
      : layout(std::move(checked_layout)),
        segment(std::move(mapped)),
        header(*reinterpret_cast<ssp_header*>(segment.bytes().data())),
        sensors(layout, SSP_SENSOR, segment.bytes().data()),
        actuators(layout, SSP_ACTUATOR, segment.bytes().data()),
        description(describe(layout, segment.bytes())),
        passive(description.mode == Mode::kPassive),
        own_process(self) {
    if (passive) private_frame = FrameArrays(layout.sensor_array_bytes());
  }
  ~Impl() { close(); }

  static std::unique_ptr<Impl> attach(const std::string& name, const AttachOptions&);
  void claim();
  void resume_session() noexcept;
  void close() noexcept;

  Status await_sensors(const WaitOptions&) noexcept;
  Status latest_sensors() noexcept;
  bool is_new(std::uint32_t newest) const noexcept;
  Status take_frame(std::uint32_t newest) noexcept;
  Status await_after_torn_frame(std::uint32_t torn, const WaitOptions&) noexcept;
  Status copy_newest() noexcept;
  std::span<const std::byte> next_cells(int channel_index, const ssp_channel&, const WaitOptions&) noexcept;
  bool try_next_cells(int channel_index, const ssp_channel&, std::span<const std::byte>& cells) noexcept;
  void abandon_answer() noexcept;
  Status publish() noexcept;
  Status surface_status(bool check_liveness) noexcept;

  SegmentLayout layout;
  Segment segment;
  ssp_header& header;
  Ring sensors, actuators;
  Description description;
  bool passive;
  ProcessIdentity own_process;
  pid_t owner_pid = ::getpid();
  bool claimed = false;

  std::uint32_t last_word = 0;  // of the last sensor frame taken
  FrameInfo info;
  bool answer_due = false;          // time-step: the last frame taken awaits its answer
  std::uint64_t last_answered = 0;  // the newest sensor frame that any controller of this session answered
  std::uint64_t frame = 0;          // last published actuator frame
  FrameArrays private_frame;        // passive: the last sensor frame taken
  Counters counters;
  WaitState wait_state, next_chunk_wait_state;  // for the first chunk or a whole frame; for later chunks

  ChunkWriter writer{header.actuator_progress, header.actuators.word, header.surface_waiting.flag,
                     layout.actuator_array_bytes()};
  ChunkCursor cursor;
};

void ControllerEndpoint::Impl::claim() {
  // A predecessor that is just leaving releases its lock after its claim.
  constexpr std::chrono::milliseconds kRetryInterval{1};
  for (int attempt = 0; attempt < 100; ++attempt) {
    const ProcessIdentity holder = load_seq_cst(header.claim.controller_process);
    const bool lives = holder != 0 && segment.liveness().is_alive(Side::kController, holder);
    if (lives && holder == load_seq_cst(header.claim.controller_process))
      throw Error(ErrorCode::kControllerLives,
                  "surface \"" + description.name + "\" already has a controller: process " +
                      std::to_string(pid_of(holder)) + "; end it first",
                  pid_of(holder));
    if (!segment.liveness().take(Side::kController)) {
      std::this_thread::sleep_for(kRetryInterval);
      continue;
    }
    if (compare_exchange(header.claim.controller_process, holder, own_process)) {
      claimed = true;
      return resume_session();
    }
  }
  throw Error(ErrorCode::kControllerLives,
              "surface \"" + description.name + "\": other controllers keep attaching first");
}

// Continues after the predecessor's last complete frame. The predecessor may have been killed between any two
// stores, so its publication line may partly describe a later frame.
void ControllerEndpoint::Impl::resume_session() noexcept {
  store_relaxed(header.controller_waiting.flag, 0);
  store_relaxed(header.actuator_progress.ready, 0);
  const std::uint32_t last = load_acquire(header.actuators.word);
  const FrameInfo whole = actuators.read_info(last);
  frame = whole.frame != 0 ? whole.frame : last;
  last_answered = whole.answers;
  store_relaxed(header.actuators.cpu, current_cpu());
  store_relaxed(header.controller.skipped, std::uint64_t{0});
  store_relaxed(header.controller.repeated, std::uint64_t{0});
  store_relaxed(header.controller.clamped, std::uint64_t{0});
  store_relaxed(header.controller.deadline_misses, std::uint64_t{0});
  // Release: a process that sees this state also sees the new claim.
  store_release(header.controller.state, static_cast<std::uint32_t>(State::kReady));
  actuators.begin_write(frame + 1);
  increment(header.claim.attached);
  if (load_seq_cst(header.surface_waiting.flag)) futex_wake(header.claim.attached);
}

void ControllerEndpoint::Impl::close() noexcept {
  if (!claimed || owner_pid != ::getpid()) return;  // a forked child holds no claim
  claimed = false;
  store_relaxed(header.controller.state, static_cast<std::uint32_t>(State::kClosing));
  increment(header.claim.detached);
  compare_exchange(header.claim.controller_process, own_process, 0);
  segment.liveness().release();
  // May be missed between the surface's check and its sleep; the surface then wakes at the end of its slice.
  if (load_seq_cst(header.surface_waiting.flag)) futex_wake(header.actuators.word);
}

std::unique_ptr<ControllerEndpoint::Impl> ControllerEndpoint::Impl::attach(const std::string& name,
                                                                           const AttachOptions& options) {
  return attach_with_retry(name, options, [&](std::string& why) -> std::unique_ptr<Impl> {
    auto found = find_surface(name, Access::kReadWrite, why);
    if (!found) return nullptr;
    auto impl =
        std::make_unique<Impl>(std::move(found->segment), std::move(found->layout), own_process_identity());
    impl->claim();
    return impl;
  });
}

Status ControllerEndpoint::Impl::surface_status(bool check_liveness) noexcept {
  const std::uint32_t state = load_acquire(header.surface.state);
  if (state == SSP_STATE_CLOSING) return Status::kSurfaceClosed;
  if (state == SSP_STATE_DEAD) return Status::kSurfaceDead;
  const ProcessIdentity surface = layout.identity.surface_process;
  return check_liveness && !segment.liveness().is_alive(Side::kSurface, surface) ? Status::kSurfaceDead
                                                                                 : Status::kOk;
}

// In time-step mode a frame is new unless this controller or a predecessor answered it.
bool ControllerEndpoint::Impl::is_new(std::uint32_t newest) const noexcept {
  if (newest == last_word) return false;
  return passive || load_relaxed(header.sensors.frame) != last_answered;
}

Status ControllerEndpoint::Impl::copy_newest() noexcept {
  for (int attempt = 0; attempt < 3; ++attempt) {
    const std::uint32_t newest = load_acquire(header.sensors.word);
    const FrameInfo taken = sensors.read_info(newest);
    if (taken.frame == 0) continue;
    for (const auto& c : layout.channels)
      if (c.direction == SSP_SENSOR)
        copy_frame(private_frame.array(c), sensors.array(newest, c).data(), c.bytes);
    if (!sensors.is_still_valid(taken)) continue;
    // Frames published before this controller attached do not count as skipped.
    if (last_word != 0) counters.skipped += newest - last_word - 1;
    store_relaxed(header.controller.skipped, counters.skipped);
    last_word = newest;
    info = taken;
    return Status::kOk;
  }
  return Status::kTorn;
}

Status ControllerEndpoint::Impl::take_frame(std::uint32_t newest) noexcept {
  if (load_acquire(header.controller.state) == SSP_STATE_READY)
    store_relaxed(header.controller.state, static_cast<std::uint32_t>(State::kRunning));
  if (passive) return copy_newest();
  if (!cursor.is_consistent_with(newest, 0)) {
    abandon_answer();
    return Status::kTorn;
  }
  // The surface modifies neither the publication line nor the slot before the answer, so the slot's header
  // need not be read.
  const FrameInfo taken = load_publication(header.sensors);
  fence_acquire();
  if (load_relaxed(header.sensors.word) != newest || static_cast<std::uint32_t>(taken.frame) != newest)
    return Status::kTorn;
  last_word = newest;
  info = taken;
  answer_due = true;
  cursor.reset();
  writer.on_answered();
  return Status::kOk;
}

Status ControllerEndpoint::Impl::await_sensors(const WaitOptions& options) noexcept {
  std::uint32_t newest = load_acquire(header.sensors.word);
  if (answer_due && newest == last_word) return Status::kOutOfTurn;
  answer_due = false;
  const auto ready = [&]() noexcept {
    newest = load_acquire(header.sensors.word);
    return is_new(newest);
  };
  const auto peer = [&](bool check_liveness) noexcept { return surface_status(check_liveness); };
  const Doorbell bell{header.sensors.word, header.controller_waiting.flag, header.sensors.cpu};
  // Retries only if a surface that has not yet adopted this controller published again in the meantime.
  for (int attempt = 0; attempt < 3; ++attempt) {
    if (const Status s = wait_until(bell, options, wait_state, ready, peer); s != Status::kOk) return s;
    const bool inconsistent = !cursor.is_consistent_with(newest, 0);
    if (take_frame(newest) == Status::kOk) return Status::kOk;
    if (inconsistent) break;  // the user must learn that the chunks are invalid
  }
  return await_after_torn_frame(newest, options);
}

// A frame stays torn if its surface is stopped or has ended within it. Waits for the next one for a slice, so
// that a caller that tries again neither spins nor misses the stop flag and the surface's end.
Status ControllerEndpoint::Impl::await_after_torn_frame(std::uint32_t torn,
                                                        const WaitOptions& options) noexcept {
  if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
  if (const Status s = surface_status(wait_state.liveness.due()); s != Status::kOk) return s;
  if (!passive || options.timeout <= options.timeout.zero()) return Status::kTorn;
  store_seq_cst(header.controller_waiting.flag, 1);
  futex_wait(header.sensors.word, torn, std::min<std::chrono::nanoseconds>(options.timeout, kSleepSlice));
  store_relaxed(header.controller_waiting.flag, 0);
  return Status::kTorn;
}

Status ControllerEndpoint::Impl::latest_sensors() noexcept {
  const std::uint32_t newest = load_acquire(header.sensors.word);
  if (is_new(newest)) {
    answer_due = false;
    const Status taken = take_frame(newest);
    if (taken != Status::kTorn) return taken;
    const Status peer = surface_status(wait_state.liveness.due());
    return peer == Status::kOk ? taken : peer;
  }
  if (const Status s = surface_status(wait_state.liveness.due()); s != Status::kOk) return s;
  store_relaxed(header.controller.repeated, ++counters.repeated);
  return Status::kRepeated;
}

// Delivers the available part of the frame being written, or of the one just published. Returns true if there
// was any, or if the cells delivered before belong to another frame.
bool ControllerEndpoint::Impl::try_next_cells(int channel_index, const ssp_channel& c,
                                              std::span<const std::byte>& cells) noexcept {
  const std::uint32_t newest = load_acquire(header.sensors.word);
  const bool whole = is_new(newest);
  const std::uint32_t frame_number = whole ? newest : newest + 1;
  if (!cursor.is_consistent_with(frame_number, 0)) return true;
  const std::size_t slot_bytes = layout.geometry.sensor_slot_bytes;
  const std::size_t end =
      whole ? slot_bytes : committed_bytes(header.sensor_progress, frame_number, slot_bytes);
  cells = cursor.next(frame_number, 0, channel_index, c, end, sensors.array(frame_number, c));
  return !cells.empty();
}

std::span<const std::byte> ControllerEndpoint::Impl::next_cells(int channel_index, const ssp_channel& c,
                                                                const WaitOptions& options) noexcept {
  if (passive || answer_due || cursor.is_exhausted(channel_index, c)) return {};
  std::span<const std::byte> cells;
  const auto ready = [&]() noexcept { return try_next_cells(channel_index, c, cells); };
  const auto peer = [&](bool check_liveness) noexcept { return surface_status(check_liveness); };
  const Doorbell bell{header.sensors.word, header.controller_waiting.flag, header.sensors.cpu};
  // The status is ignored: await_sensors() determines why there are no cells.
  (void)wait_until(bell, options, cursor.has_started() ? next_chunk_wait_state : wait_state, ready, peer);
  return cells;
}

// The surface may have read chunks of an answer that will not be published. The next answer gets a new frame
// number, so that the two cannot be mixed.
void ControllerEndpoint::Impl::abandon_answer() noexcept {
  cursor.reset();
  if (!writer.has_announced(frame + 1)) return;
  ++frame;
  actuators.begin_write(frame + 1);
}

Status ControllerEndpoint::Impl::publish() noexcept {
  if (!claimed) return Status::kOutOfTurn;  // closed: another controller may hold the claim
  if (!passive) {
    if (!answer_due) return Status::kOutOfTurn;
    answer_due = false;
    if (load_acquire(header.sensors.word) != last_word) {
      abandon_answer();
      return Status::kTorn;
    }
    last_answered = info.frame;
  }
  ++frame;
  const FrameInfo now{frame, info.tick, info.time_s, info.frame, 0};
  writer.finish_frame(frame);
  actuators.end_write(now);
  store_publication(header.actuators, now, current_cpu());
  store_and_wake(header.actuators.word, static_cast<std::uint32_t>(frame), header.surface_waiting.flag);
  actuators.begin_write(frame + 1);
  return Status::kOk;
}

ControllerEndpoint::ControllerEndpoint(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ControllerEndpoint::ControllerEndpoint(ControllerEndpoint&&) noexcept = default;
ControllerEndpoint& ControllerEndpoint::operator=(ControllerEndpoint&&) noexcept = default;
ControllerEndpoint::~ControllerEndpoint() = default;

ControllerEndpoint ControllerEndpoint::attach(const std::string& name, const AttachOptions& options) {
  return ControllerEndpoint(Impl::attach(name, options));
}

void ControllerEndpoint::reconnect(const AttachOptions& options) {
  impl_->close();
  auto next = Impl::attach(impl_->description.name, options);
  if (next->description.layout_hash != impl_->description.layout_hash)
    throw Error(ErrorCode::kLayoutChanged,
                "surface \"" + next->description.name +
                    "\" came back with another size or other channels; restart the controller");
  impl_ = std::move(next);
}

void ControllerEndpoint::close() noexcept { impl_->close(); }

const Description& ControllerEndpoint::description() const noexcept { return impl_->description; }

std::span<const std::byte> ControllerEndpoint::sensor_bytes(int channel, DType dtype) const noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_SENSOR, dtype);
  if (impl_->passive) return impl_->private_frame.bytes(c);
  return impl_->sensors.array(impl_->last_word, c);
}

std::span<std::byte> ControllerEndpoint::actuator_bytes(int channel, DType dtype) noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_ACTUATOR, dtype);
  return impl_->actuators.array(impl_->frame + 1, c);
}

std::span<const std::byte> ControllerEndpoint::published_bytes(int channel, DType dtype) const noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_ACTUATOR, dtype);
  return impl_->actuators.array(impl_->frame, c);
}

std::span<const std::byte> ControllerEndpoint::next_bytes(int channel, DType dtype,
                                                          const WaitOptions& options) noexcept {
  return impl_->next_cells(channel, impl_->layout.channel(channel, SSP_SENSOR, dtype), options);
}

void ControllerEndpoint::write_bytes(int channel, DType dtype, std::size_t at,
                                     std::span<const std::byte> values) noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_ACTUATOR, dtype);
  assert(at <= c.bytes && values.size() <= c.bytes - at);
  const std::uint64_t next = impl_->frame + 1;
  auto* slot = reinterpret_cast<std::byte*>(&impl_->actuators.slot(next));
  impl_->writer.write(slot, next, c, at, values, is_on_other_core(impl_->header.sensors.cpu));
}

Status ControllerEndpoint::await_sensors(const WaitOptions& options) noexcept {
  return impl_->await_sensors(options);
}
Status ControllerEndpoint::latest_sensors() noexcept { return impl_->latest_sensors(); }
Status ControllerEndpoint::publish() noexcept { return impl_->publish(); }
Status ControllerEndpoint::surface_status() noexcept { return impl_->surface_status(true); }
const FrameInfo& ControllerEndpoint::sensor_info() const noexcept { return impl_->info; }
void ControllerEndpoint::set_state(State state) noexcept {
  store_release(impl_->header.controller.state, static_cast<std::uint32_t>(state));
}
State ControllerEndpoint::surface_state() const noexcept {
  return static_cast<State>(load_acquire(impl_->header.surface.state));
}
Counters ControllerEndpoint::counters() const noexcept { return impl_->counters; }
Counters ControllerEndpoint::surface_counters() const noexcept {
  return load_counters(impl_->header.surface);
}

}  // namespace shm_protocol
