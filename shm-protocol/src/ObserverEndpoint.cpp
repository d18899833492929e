#include "shm_protocol/ObserverEndpoint.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <chrono>
#include <thread>
#include <utility>

#include "shm-protocol/src/ring/FrameArrays.h"
#include "shm-protocol/src/ring/FrameCopy.h"
#include "shm-protocol/src/ring/Ring.h"
#include "shm-protocol/src/segment/Discovery.h"
#include "shm-protocol/src/segment/ProcessIdentity.h"
#include "shm-protocol/src/segment/Segment.h"
#include "shm-protocol/src/segment/SegmentLayout.h"
#include "shm-protocol/src/wait/FutexWait.h"

namespace shm_protocol {
namespace {

constexpr std::chrono::milliseconds kPollInterval{1};
constexpr int kMaxAttempts = 16;  // more than a controller's 3: an observer has no deadline

// The reader's state of one direction.
struct DirectionReader {
  DirectionReader(RingView where, const ssp_publication& at, ssp_direction which, std::size_t array_bytes)
      : ring(where), line(at), direction(which), frames{FrameArrays(array_bytes), FrameArrays(array_bytes)} {}

  const FrameArrays& current_arrays() const noexcept { return frames[current]; }

  RingView ring;
  const ssp_publication& line;
  ssp_direction direction;
  std::array<FrameArrays, 2> frames;  // [current] is valid; the other receives the next frame
  std::size_t current = 0;
  FrameInfo info;
};

}  // namespace

struct ObserverEndpoint::Impl {
  Impl(Segment mapped, SegmentLayout checked_layout)
      : layout(std::move(checked_layout)),
        segment(std::move(mapped)),
        header(*reinterpret_cast<const ssp_header*>(segment.bytes().data())),
        description(describe(layout, segment.bytes())),
        sensors({layout, SSP_SENSOR, segment.bytes().data()}, header.sensors, SSP_SENSOR,
                layout.sensor_array_bytes()),
        actuators({layout, SSP_ACTUATOR, segment.bytes().data()}, header.actuators, SSP_ACTUATOR,
                  layout.actuator_array_bytes()) {}

  const DirectionReader& reader(Direction d) const noexcept {
    return d == Direction::kSensor ? sensors : actuators;
  }
  DirectionReader& reader(Direction d) noexcept { return d == Direction::kSensor ? sensors : actuators; }

  bool copy(DirectionReader&, std::uint32_t frame) noexcept;
  Status copy_newest(DirectionReader&) noexcept;
  Status copy_next(DirectionReader&) noexcept;
  Status latest(Direction direction) noexcept { return with_state(copy_newest(reader(direction))); }
  Status next(Direction direction) noexcept { return with_state(copy_next(reader(direction))); }
  Status with_state(Status) noexcept;
  State surface_state(bool check_liveness) noexcept;

  SegmentLayout layout;
  Segment segment;
  const ssp_header& header;
  Description description;
  DirectionReader sensors, actuators;
  LivenessTimer liveness;
};

// Copies the frame whose low 32 bits are given. Returns false if it is not in its slot, or did not stay
// there.
bool ObserverEndpoint::Impl::copy(DirectionReader& reader, std::uint32_t frame) noexcept {
  const FrameInfo taken = reader.ring.read_info(frame);
  if (taken.frame == 0) return false;
  const FrameArrays& to = reader.frames[1 - reader.current];
  for (const auto& c : layout.channels)
    if (c.direction == static_cast<std::uint32_t>(reader.direction))
      copy_frame(to.array(c), reader.ring.array(frame, c).data(), c.bytes);
  if (!reader.ring.is_still_valid(taken)) return false;
  reader.current = 1 - reader.current;
  reader.info = taken;
  return true;
}

Status ObserverEndpoint::Impl::copy_newest(DirectionReader& reader) noexcept {
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    const std::uint32_t newest = load_acquire(reader.line.word);
    if (newest == static_cast<std::uint32_t>(reader.info.frame)) return Status::kRepeated;
    if (copy(reader, newest)) return Status::kOk;
  }
  return Status::kTorn;
}

// Frames that the writer overwrites meanwhile are passed over.
Status ObserverEndpoint::Impl::copy_next(DirectionReader& reader) noexcept {
  if (reader.info.frame == 0) return copy_newest(reader);
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    const std::uint32_t newest = load_acquire(reader.line.word);
    const auto behind = newest - static_cast<std::uint32_t>(reader.info.frame);
    if (behind == 0) return Status::kRepeated;
    const auto readable = static_cast<std::uint32_t>(reader.ring.slot_count());
    for (std::uint32_t frame = newest - std::min(behind, readable) + 1; frame != newest + 1; ++frame)
      if (copy(reader, frame)) return Status::kOk;
  }
  return Status::kTorn;
}

Status ObserverEndpoint::Impl::with_state(Status s) noexcept {
  if (s != Status::kRepeated && s != Status::kTorn) return s;
  switch (surface_state(liveness.due())) {
    case State::kClosing:
      return Status::kSurfaceClosed;
    case State::kDead:
      return Status::kSurfaceDead;
    default:
      return s;
  }
}

State ObserverEndpoint::Impl::surface_state(bool check_liveness) noexcept {
  const auto state = static_cast<State>(load_acquire(header.surface.state));
  if (state == State::kClosing || !check_liveness) return state;
  return segment.liveness().is_alive(Side::kSurface, layout.identity.surface_process) ? state : State::kDead;
}

ObserverEndpoint::ObserverEndpoint(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObserverEndpoint::ObserverEndpoint(ObserverEndpoint&&) noexcept = default;
ObserverEndpoint& ObserverEndpoint::operator=(ObserverEndpoint&&) noexcept = default;
ObserverEndpoint::~ObserverEndpoint() = default;

ObserverEndpoint ObserverEndpoint::attach(const std::string& name, const AttachOptions& options) {
  const auto try_attach = [&](std::string& why) -> std::unique_ptr<Impl> {
    auto found = find_surface(name, Access::kReadOnly, why);
    if (!found) return nullptr;
    return std::make_unique<Impl>(std::move(found->segment), std::move(found->layout));
  };
  return ObserverEndpoint(attach_with_retry(name, options, try_attach));
}

const Description& ObserverEndpoint::description() const noexcept { return impl_->description; }

Status ObserverEndpoint::latest(Direction direction) noexcept { return impl_->latest(direction); }

Status ObserverEndpoint::next(Direction direction) noexcept { return impl_->next(direction); }

Status ObserverEndpoint::await(Direction direction, const WaitOptions& options) noexcept {
  const auto start = Clock::now();
  for (;;) {
    const Status s = impl_->latest(direction);
    if (s != Status::kRepeated && s != Status::kTorn) return s;
    if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (Clock::now() - start >= options.timeout) return Status::kTimeout;
    std::this_thread::sleep_for(kPollInterval);
  }
}

std::span<const std::byte> ObserverEndpoint::bytes(int channel, DType dtype) const noexcept {
  const auto& c = impl_->layout.channels[channel];
  assert(c.dtype == static_cast<std::uint32_t>(dtype));
  return impl_->reader(static_cast<Direction>(c.direction)).current_arrays().bytes(c);
}

const FrameInfo& ObserverEndpoint::info(Direction direction) const noexcept {
  return impl_->reader(direction).info;
}
std::uint32_t ObserverEndpoint::published(Direction direction) const noexcept {
  return load_acquire(impl_->reader(direction).line.word);
}

State ObserverEndpoint::surface_state() const noexcept { return impl_->surface_state(true); }

State ObserverEndpoint::controller_state() const noexcept {
  const ProcessIdentity controller = load_acquire(impl_->header.claim.controller_process);
  if (controller == 0) return State::kNone;
  if (!impl_->segment.liveness().is_alive(Side::kController, controller)) return State::kDead;
  return static_cast<State>(load_acquire(impl_->header.controller.state));
}
std::uint32_t ObserverEndpoint::controller_pid() const noexcept {
  return pid_of(load_acquire(impl_->header.claim.controller_process));
}
std::uint32_t ObserverEndpoint::controllers_seen() const noexcept {
  return load_acquire(impl_->header.claim.attached);
}
Counters ObserverEndpoint::surface_counters() const noexcept { return load_counters(impl_->header.surface); }
Counters ObserverEndpoint::controller_counters() const noexcept {
  return load_counters(impl_->header.controller);
}

}  // namespace shm_protocol
