#include "shm_protocol/SurfaceEndpoint.h"

#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

#include "Arrays.h"
#include "FrameCopy.h"
#include "Geometry.h"
#include "Pieces.h"
#include "Process.h"
#include "Ring.h"
#include "Segment.h"
#include "Waiting.h"

namespace shm_protocol {
namespace {

std::uint64_t random_session() {
  std::uint64_t session = 0;
  while (session == 0)
    if (::getrandom(&session, sizeof session, 0) != sizeof session)
      throw Error(ErrorCode::kSystem, "getrandom failed");
  return session;
}

}  // namespace

struct SurfaceEndpoint::Impl {
  Impl(const SurfaceConfig& config, Geometry plan)
      : geometry(std::move(plan)),
        segment(
            Segment::build(config.name, geometry.identity.segment_bytes, geometry.identity.surface_process)),
        header(*reinterpret_cast<ssp_header*>(segment.bytes().data())),
        sensors(Ring::of_sensors(geometry, segment.bytes().data())),
        actuators(Ring::of_actuators(geometry, segment.bytes().data())),
        hold_last_frame(config.hold_last_frame),
        frames{Arrays(geometry.actuator_array_bytes()), Arrays(geometry.actuator_array_bytes())} {
    write_fixed_part(geometry, config, segment.bytes());
    description = describe(geometry, segment.bytes());
    show_safe_frame();
    large = geometry.actuator_array_bytes() >= kLargeFrame;
    store_relaxed(header.sensors.cpu, current_cpu());
    set_state(State::kReady);
    sensors.open(1);
    store_release(header.identity.version, std::uint32_t{SSP_VERSION});
    segment.put_in_place();
  }

  void set_state(State next) noexcept {
    if (next == state) return;
    state = next;
    store_sequential(header.surface.state, static_cast<std::uint32_t>(next));
  }

  Status publish(std::uint64_t at_tick, double time_s, std::uint32_t status) noexcept;
  Status await_actuators(std::uint64_t at_tick, const WaitOptions&) noexcept;
  Status latest_actuators() noexcept;
  Status await_controller(const WaitOptions&) noexcept;

  // kOk while the controller we know is attached; adopts a new one; tells of the loss of the old one once.
  Status controller_status(bool look_up) noexcept;
  void adopt() noexcept;
  Status lose(Status how) noexcept;
  bool take_in(std::uint32_t word) noexcept;
  void copy_arrays(std::uint32_t word, std::size_t from, std::size_t to) noexcept;
  void copy_all(std::uint32_t word) noexcept;
  void copy_along() noexcept;
  void accept(const FrameInfo&) noexcept;
  void show_safe_frame() noexcept;

  Geometry geometry;
  Segment segment;
  ssp_header& header;
  Ring sensors, actuators;
  Description description;
  pid_t owner = ::getpid();
  bool closed = false;

  State state = State::kNone;
  std::uint64_t frame = 0;  // published last
  std::uint64_t tick = 0;
  bool answered = false;  // the frame published last was answered
  bool settled = true;    // it was answered or given up: the next may be published

  std::uint32_t word = 0;  // of the actuator frame looked at last
  FrameInfo info;          // of the actuator frame shown
  bool hold_last_frame;
  std::array<Arrays, 2> frames;  // [shown] is what actuator() shows, the other takes the next frame in
  std::size_t shown = 0;
  std::uint64_t replaced = 0;  // values, in the copy made last
  Counters counters;

  ProcessWord controller = 0;     // whom we know
  std::uint32_t detachments = 0;  // counted when we adopted it
  Patience patience;

  PieceWriter writer{header.sensor_progress, header.sensors.word, header.controller_waiting.flag};
  PieceReader pieces{header.actuator_progress};
  bool large = false;  // actuator frames are
};

void SurfaceEndpoint::Impl::show_safe_frame() noexcept {
  info = {};
  for (const auto& c : geometry.channels) {
    if (c.direction != SSP_ACTUATOR) continue;
    const auto bytes = frames[shown].bytes(c);
    if (c.dtype == SSP_F32) std::ranges::fill(as_array<float>(bytes), static_cast<float>(c.safe));
    if (c.dtype == SSP_U32)
      std::ranges::fill(as_array<std::uint32_t>(bytes), static_cast<std::uint32_t>(c.safe));
    if (c.dtype == SSP_U8)
      std::ranges::fill(as_array<std::uint8_t>(bytes), static_cast<std::uint8_t>(c.safe));
  }
}

void SurfaceEndpoint::Impl::adopt() noexcept {
  // Between two equal counts of departures the process word belongs to one attachment.
  for (int attempt = 0; attempt < 4; ++attempt) {
    detachments = load_sequential(header.claim.detached);
    controller = load_sequential(header.claim.controller_process);
    if (load_sequential(header.claim.detached) == detachments) return;
  }
}

Status SurfaceEndpoint::Impl::lose(Status how) noexcept {
  controller = 0;
  if (!hold_last_frame) show_safe_frame();
  return how;
}

Status SurfaceEndpoint::Impl::controller_status(bool look_up) noexcept {
  if (controller == 0) adopt();
  if (controller == 0) return Status::kNoController;
  if (load_acquire(header.claim.controller_process) != controller) {
    const bool in_order = load_sequential(header.claim.detached) != detachments;
    return lose(in_order ? Status::kControllerClosed : Status::kControllerDead);
  }
  if (!look_up || is_alive(controller)) return Status::kOk;
  // It fails when a new controller has just taken the place; then that one keeps it.
  exchange_if(header.claim.controller_process, controller, 0);
  return lose(Status::kControllerDead);
}

Status SurfaceEndpoint::Impl::publish(std::uint64_t at_tick, double time_s, std::uint32_t status) noexcept {
  if (closed || (description.mode == Mode::kTimeStep && !settled)) return Status::kOutOfTurn;
  if (state == State::kReady) set_state(State::kRunning);
  tick = at_tick;
  ++frame;
  const FrameInfo now{frame, tick, time_s, 0, status};
  sensors.close(now);
  announce(header.sensors, now, current_cpu());
  ring(header.sensors.word, static_cast<std::uint32_t>(frame), header.controller_waiting.flag);
  sensors.open(frame + 1);
  answered = settled = false;
  return Status::kOk;
}

// Bytes `from` to `to` of that frame's slot.
void SurfaceEndpoint::Impl::copy_arrays(std::uint32_t of, std::size_t from, std::size_t to) noexcept {
  for (const auto& c : geometry.channels) {
    if (c.direction != SSP_ACTUATOR) continue;
    part_of(c, from, to, [&](std::size_t at, std::size_t bytes) {
      replaced += copy_checked(frames[1 - shown].array(c) + at, actuators.array(of, c).data() + at, bytes, c);
    });
  }
}

void SurfaceEndpoint::Impl::copy_all(std::uint32_t of) noexcept {
  replaced = 0;
  copy_arrays(of, sizeof(ssp_slot), geometry.geometry.actuator_slot_bytes);
}

// While the controller still writes the next frame.
void SurfaceEndpoint::Impl::copy_along() noexcept {
  pieces.look(word + 1, load_acquire(header.claim.attached), geometry.geometry.actuator_slot_bytes,
              [&](std::size_t from, std::size_t to) {
                if (from == sizeof(ssp_slot)) replaced = 0;
                ++patience.pieces;
                copy_arrays(word + 1, from, to);
              });
}

void SurfaceEndpoint::Impl::accept(const FrameInfo& taken) noexcept {
  shown = 1 - shown;
  info = taken;
  if (replaced == 0) return;
  counters.clamped += replaced;
  store_relaxed(header.surface.clamped, counters.clamped);
}

// Time-step: the controller may not touch the frame before it sees the next sensor frame, so an unchanged
// word is proof enough, and the slot's own line need not travel between the cores.
bool SurfaceEndpoint::Impl::take_in(std::uint32_t from) noexcept {
  word = from;
  const FrameInfo taken = announced(header.actuators);
  const std::size_t rest = pieces.finish(from, load_acquire(header.claim.attached));
  if (rest == sizeof(ssp_slot)) replaced = 0;
  copy_arrays(from, rest, geometry.geometry.actuator_slot_bytes);
  fence_acquire();
  if (load_relaxed(header.actuators.word) != from || static_cast<std::uint32_t>(taken.frame) != from)
    return false;
  accept(taken);
  return true;
}

Status SurfaceEndpoint::Impl::await_actuators(std::uint64_t at_tick, const WaitOptions& options) noexcept {
  if (description.mode != Mode::kTimeStep || frame == 0 || at_tick != tick) return Status::kOutOfTurn;
  if (answered) return Status::kOk;
  std::uint32_t newest = word;
  const auto ready = [&]() noexcept {
    newest = load_acquire(header.actuators.word);
    if (newest != word && load_relaxed(header.actuators.answers) == frame) return true;
    if (large) copy_along();
    return false;
  };
  const Doorbell bell{header.actuators.word, header.surface_waiting.flag, header.actuators.cpu};
  const Status status = wait_until(bell, options, patience, ready,
                                   [&](bool look_up) noexcept { return controller_status(look_up); });
  switch (status) {
    case Status::kOk:
      if (!take_in(newest)) return Status::kTorn;
      answered = settled = true;
      return Status::kOk;
    case Status::kNoController:
    case Status::kControllerDead:
    case Status::kControllerClosed:
      settled = true;
      return status;
    default:
      return status;
  }
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

Status SurfaceEndpoint::Impl::await_controller(const WaitOptions& options) noexcept {
  const Doorbell bell{header.claim.attached, header.surface_waiting.flag, header.actuators.cpu};
  const auto ready = [&]() noexcept { return load_acquire(header.claim.controller_process) != 0; };
  for (;;) {
    // Without a controller only the deadline or the stop flag may end the wait.
    const Status s = wait_until(bell, options, patience, ready, [](bool) noexcept { return Status::kOk; });
    if (s != Status::kOk) return s;
    const Status who = controller_status(true);
    if (who == Status::kOk) return who;
    // One that died before we looked: wait for the next.
  }
}

SurfaceEndpoint::SurfaceEndpoint(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SurfaceEndpoint::SurfaceEndpoint(SurfaceEndpoint&&) noexcept = default;

SurfaceEndpoint& SurfaceEndpoint::operator=(SurfaceEndpoint&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

SurfaceEndpoint SurfaceEndpoint::create(const SurfaceConfig& config) {
  Geometry geometry = plan(config);
  geometry.identity.surface_process = own_process_word();
  geometry.identity.session = random_session();
  reclaim_or_refuse(config.name);  // before memory is reserved for a second one
  return SurfaceEndpoint(std::make_unique<Impl>(config, std::move(geometry)));
}

SurfaceEndpoint::~SurfaceEndpoint() {
  if (impl_) close();
}

void SurfaceEndpoint::close() noexcept {
  if (impl_->closed || impl_->owner != ::getpid()) return;  // a forked child owns nothing
  impl_->closed = true;
  impl_->set_state(State::kClosing);
  futex_wake(impl_->header.sensors.word);
  impl_->segment.remove();
}

const Description& SurfaceEndpoint::description() const noexcept { return impl_->description; }

std::span<std::byte> SurfaceEndpoint::sensor_bytes(int channel, [[maybe_unused]] DType dtype) noexcept {
  const auto& c = impl_->geometry.channels[static_cast<std::size_t>(channel)];
  assert(c.direction == SSP_SENSOR && c.dtype == static_cast<std::uint32_t>(dtype));
  return impl_->sensors.array(impl_->frame + 1, c);
}

std::span<const std::byte> SurfaceEndpoint::actuator_bytes(int channel,
                                                           [[maybe_unused]] DType dtype) const noexcept {
  const auto& c = impl_->geometry.channels[static_cast<std::size_t>(channel)];
  assert(c.direction == SSP_ACTUATOR && c.dtype == static_cast<std::uint32_t>(dtype));
  return impl_->frames[impl_->shown].bytes(c);
}

void SurfaceEndpoint::write_bytes(int channel, [[maybe_unused]] DType dtype, std::size_t at,
                                  std::span<const std::byte> values) noexcept {
  const auto& c = impl_->geometry.channels[static_cast<std::size_t>(channel)];
  assert(c.direction == SSP_SENSOR && c.dtype == static_cast<std::uint32_t>(dtype));
  assert(at <= c.bytes && values.size() <= c.bytes - at);
  const std::uint64_t next = impl_->frame + 1;
  auto* slot = reinterpret_cast<std::byte*>(&impl_->sensors.slot(next));
  impl_->writer.write(slot, next, c, at, values,
                      values.size() >= kStreamed && is_elsewhere(impl_->header.actuators.cpu));
}

Status SurfaceEndpoint::publish(std::uint64_t tick, double time_s, std::uint32_t status) noexcept {
  return impl_->publish(tick, time_s, status);
}
Status SurfaceEndpoint::await_actuators(std::uint64_t tick, const WaitOptions& options) noexcept {
  return impl_->await_actuators(tick, options);
}
Status SurfaceEndpoint::latest_actuators() noexcept { return impl_->latest_actuators(); }
Status SurfaceEndpoint::await_controller(const WaitOptions& options) noexcept {
  return impl_->await_controller(options);
}
const FrameInfo& SurfaceEndpoint::actuator_info() const noexcept { return impl_->info; }
void SurfaceEndpoint::set_state(State state) noexcept { impl_->set_state(state); }

bool SurfaceEndpoint::has_controller() const noexcept { return controller_pid() != 0; }
std::uint32_t SurfaceEndpoint::controller_pid() const noexcept {
  return pid_of(load_acquire(impl_->header.claim.controller_process));
}
std::uint32_t SurfaceEndpoint::controllers_seen() const noexcept {
  return load_acquire(impl_->header.claim.attached);
}
State SurfaceEndpoint::controller_state() const noexcept {
  return static_cast<State>(load_acquire(impl_->header.controller.state));
}
Counters SurfaceEndpoint::counters() const noexcept { return impl_->counters; }
Counters SurfaceEndpoint::controller_counters() const noexcept {
  return counters_of(impl_->header.controller);
}
void SurfaceEndpoint::miss_deadline() noexcept {
  store_relaxed(impl_->header.surface.deadline_misses, ++impl_->counters.deadline_misses);
}

}  // namespace shm_protocol
