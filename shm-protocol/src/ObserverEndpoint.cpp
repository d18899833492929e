#include "shm_protocol/ObserverEndpoint.h"

#include <array>
#include <cassert>
#include <chrono>
#include <thread>
#include <utility>

#include "Arrays.h"
#include "Attaching.h"
#include "FrameCopy.h"
#include "Geometry.h"
#include "Process.h"
#include "Ring.h"
#include "Segment.h"
#include "Waiting.h"

namespace shm_protocol {
namespace {

constexpr std::chrono::milliseconds kPoll{1};
constexpr int kTries = 16;  // an observer is in no hurry: a controller has 3

// What is kept of one direction.
struct Tap {
  Tap(RingView where, const ssp_publication& at, ssp_direction which, std::size_t array_bytes)
      : ring(where), line(at), direction(which), frames{Arrays(array_bytes), Arrays(array_bytes)} {}

  const Arrays& shown_arrays() const noexcept { return frames[shown]; }

  RingView ring;
  const ssp_publication& line;
  ssp_direction direction;
  std::array<Arrays, 2> frames;  // [shown] stands, the other takes the next frame in
  std::size_t shown = 0;
  FrameInfo info;
};

}  // namespace

struct ObserverEndpoint::Impl {
  Impl(Segment mapped, Geometry checked)
      : geometry(std::move(checked)),
        segment(std::move(mapped)),
        header(*reinterpret_cast<const ssp_header*>(segment.bytes().data())),
        description(describe(geometry, segment.bytes())),
        sensors(RingView::of_sensors(geometry, segment.bytes().data()), header.sensors, SSP_SENSOR,
                geometry.sensor_array_bytes()),
        actuators(RingView::of_actuators(geometry, segment.bytes().data()), header.actuators, SSP_ACTUATOR,
                  geometry.actuator_array_bytes()) {}

  const Tap& tap(Direction d) const noexcept { return d == Direction::kSensor ? sensors : actuators; }
  Tap& tap(Direction d) noexcept { return d == Direction::kSensor ? sensors : actuators; }

  Status copy_newest(Tap&) noexcept;
  Status look(Direction) noexcept;
  State surface_state(bool look_up) const noexcept;

  Geometry geometry;
  Segment segment;
  const ssp_header& header;
  Description description;
  Tap sensors, actuators;
  LivenessClock liveness;
};

Status ObserverEndpoint::Impl::copy_newest(Tap& tap) noexcept {
  for (int attempt = 0; attempt < kTries; ++attempt) {
    const std::uint32_t newest = load_acquire(tap.line.word);
    if (newest == static_cast<std::uint32_t>(tap.info.frame)) return Status::kRepeated;
    const FrameInfo taken = tap.ring.stamp(newest);
    if (taken.frame == 0) continue;
    const Arrays& to = tap.frames[1 - tap.shown];
    for (const auto& c : geometry.channels)
      if (c.direction == static_cast<std::uint32_t>(tap.direction))
        copy_frame(to.array(c), tap.ring.array(newest, c).data(), c.bytes);
    if (!tap.ring.still_whole(taken)) continue;
    tap.shown = 1 - tap.shown;
    tap.info = taken;
    return Status::kOk;
  }
  return Status::kTorn;
}

Status ObserverEndpoint::Impl::look(Direction direction) noexcept {
  const Status s = copy_newest(tap(direction));
  if (s != Status::kRepeated) return s;
  switch (surface_state(liveness.due())) {
    case State::kClosing:
      return Status::kSurfaceClosed;
    case State::kDead:
      return Status::kSurfaceDead;
    default:
      return Status::kRepeated;
  }
}

State ObserverEndpoint::Impl::surface_state(bool look_up) const noexcept {
  const auto state = static_cast<State>(load_acquire(header.surface.state));
  if (state == State::kClosing || !look_up) return state;
  return is_alive(geometry.identity.surface_process) ? state : State::kDead;
}

ObserverEndpoint::ObserverEndpoint(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObserverEndpoint::ObserverEndpoint(ObserverEndpoint&&) noexcept = default;
ObserverEndpoint& ObserverEndpoint::operator=(ObserverEndpoint&&) noexcept = default;
ObserverEndpoint::~ObserverEndpoint() = default;

ObserverEndpoint ObserverEndpoint::attach(const std::string& name, const AttachOptions& options) {
  const auto try_attach = [&](std::string& why) -> std::unique_ptr<Impl> {
    auto found = find_surface(name, Access::kReadOnly, why);
    if (!found) return nullptr;
    return std::make_unique<Impl>(std::move(found->segment), std::move(found->geometry));
  };
  return ObserverEndpoint(attach_until(name, options, try_attach));
}

const Description& ObserverEndpoint::description() const noexcept { return impl_->description; }

Status ObserverEndpoint::look(Direction direction) noexcept { return impl_->look(direction); }

Status ObserverEndpoint::await(Direction direction, const WaitOptions& options) noexcept {
  const auto start = Clock::now();
  for (;;) {
    const Status s = impl_->look(direction);
    if (s != Status::kRepeated && s != Status::kTorn) return s;
    if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (Clock::now() - start >= options.timeout) return Status::kTimeout;
    std::this_thread::sleep_for(kPoll);
  }
}

std::span<const std::byte> ObserverEndpoint::bytes(int channel, [[maybe_unused]] DType dtype) const noexcept {
  const auto& c = impl_->geometry.channels[static_cast<std::size_t>(channel)];
  assert(c.dtype == static_cast<std::uint32_t>(dtype));
  return impl_->tap(static_cast<Direction>(c.direction)).shown_arrays().bytes(c);
}

const FrameInfo& ObserverEndpoint::info(Direction direction) const noexcept {
  return impl_->tap(direction).info;
}
std::uint32_t ObserverEndpoint::published(Direction direction) const noexcept {
  return load_acquire(impl_->tap(direction).line.word);
}

State ObserverEndpoint::surface_state() const noexcept { return impl_->surface_state(true); }

State ObserverEndpoint::controller_state() const noexcept {
  const ProcessWord controller = load_acquire(impl_->header.claim.controller_process);
  if (controller == 0) return State::kNone;
  if (!is_alive(controller)) return State::kDead;
  return static_cast<State>(load_acquire(impl_->header.controller.state));
}
std::uint32_t ObserverEndpoint::controller_pid() const noexcept {
  return pid_of(load_acquire(impl_->header.claim.controller_process));
}
std::uint32_t ObserverEndpoint::controllers_seen() const noexcept {
  return load_acquire(impl_->header.claim.attached);
}
Counters ObserverEndpoint::surface_counters() const noexcept { return counters_of(impl_->header.surface); }
Counters ObserverEndpoint::controller_counters() const noexcept {
  return counters_of(impl_->header.controller);
}

}  // namespace shm_protocol
