#include "shm_protocol/SurfaceEndpoint.h"

#include <sys/random.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "SurfaceImpl.h"

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

void SurfaceEndpoint::Impl::apply_safe_values() noexcept {
  info = {};
  current_in_place = false;
  for (const auto& c : layout.channels)
    if (c.direction == SSP_ACTUATOR) fill_safe(frames[current].bytes(c), c);
}

// Copies the current frame out of its slot, because the next controller may overwrite the slots.
void SurfaceEndpoint::Impl::preserve_current_frame() noexcept {
  if (!current_in_place) return;
  for (const auto& c : layout.channels)
    if (c.direction == SSP_ACTUATOR)
      (void)copy_sanitized(frames[current].array(c), actuators.array(info.frame, c).data(), c.bytes, c);
  current_in_place = false;
}

void SurfaceEndpoint::Impl::adopt_controller() noexcept {
  // If the count of departures and the process word are unchanged afterwards, the word and the state belong
  // to one attachment.
  for (int attempt = 0; attempt < 4; ++attempt) {
    known_detached = load_seq_cst(header.claim.detached);
    controller = load_seq_cst(header.claim.controller_process);
    controller_closing = load_acquire(header.controller.state) == SSP_STATE_CLOSING;
    if (load_seq_cst(header.claim.controller_process) == controller &&
        load_seq_cst(header.claim.detached) == known_detached)
      break;
  }
  (void)segment.liveness().is_alive(Side::kController,
                                    controller);  // from now on its lock decides, if it has one
}

// Returns whether a controller that no longer holds the claim closed in good order.
// ControllerEndpoint::close() sets the state, increments `detached`, then frees the claim; controller_closing
// covers an adoption in between.
bool SurfaceEndpoint::Impl::has_detached() const noexcept {
  return controller_closing || load_seq_cst(header.claim.detached) != known_detached;
}

Status SurfaceEndpoint::Impl::release_controller(Status status) noexcept {
  controller = 0;
  known_detached = load_seq_cst(header.claim.detached);
  if (hold_last_frame)
    preserve_current_frame();
  else
    apply_safe_values();
  return status;
}

Status SurfaceEndpoint::Impl::controller_status(bool check_liveness) noexcept {
  if (controller == 0) {
    const std::uint32_t before = known_detached;
    adopt_controller();
    if (std::exchange(unknown_answered, false) && known_detached != before)
      return release_controller(Status::kControllerClosed);
  }
  if (controller == 0) return Status::kNoController;
  if (load_acquire(header.claim.controller_process) != controller)
    return release_controller(has_detached() ? Status::kControllerClosed : Status::kControllerDead);
  if (!check_liveness || segment.liveness().is_alive(Side::kController, controller)) return Status::kOk;
  // Fails if a new controller has just claimed the role, which it then keeps.
  compare_exchange(header.claim.controller_process, controller, 0);
  return release_controller(Status::kControllerDead);
}

Status SurfaceEndpoint::Impl::publish(std::uint64_t at_tick, double time_s, std::uint32_t status) noexcept {
  if (closed || (description.mode == Mode::kTimeStep && !may_publish)) return Status::kOutOfTurn;
  if (state == State::kReady) set_state(State::kRunning);
  tick = at_tick;
  ++frame;
  const FrameInfo now{frame, tick, time_s, 0, status};
  writer.finish_frame(frame);
  sensors.end_write(now);
  store_publication(header.sensors, now, current_cpu());
  store_and_wake(header.sensors.word, static_cast<std::uint32_t>(frame), header.controller_waiting.flag);
  sensors.begin_write(frame + 1);
  answered = may_publish = false;
  return Status::kOk;
}

Status SurfaceEndpoint::Impl::await_controller(const WaitOptions& options) noexcept {
  const Doorbell bell{header.claim.attached, header.surface_waiting.flag, header.actuators.cpu};
  const auto ready = [&]() noexcept { return load_acquire(header.claim.controller_process) != 0; };
  for (;;) {
    // Without a controller only the deadline or the stop flag may end the wait.
    const Status s = wait_until(bell, options, wait_state, ready, [](bool) noexcept { return Status::kOk; });
    if (s != Status::kOk) return s;
    const Status who = controller_status(true);
    if (who == Status::kOk) return who;
    // The controller died before it was adopted: wait for the next one.
  }
}

SurfaceEndpoint::SurfaceEndpoint(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SurfaceEndpoint::SurfaceEndpoint(SurfaceEndpoint&&) noexcept = default;

SurfaceEndpoint& SurfaceEndpoint::operator=(SurfaceEndpoint&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

SurfaceEndpoint SurfaceEndpoint::create(const SurfaceConfig& config) {
  SegmentLayout layout = plan_layout(config);
  layout.identity.surface_process = own_process_identity();
  layout.identity.session = random_session();
  return SurfaceEndpoint(std::make_unique<Impl>(config, std::move(layout)));
}

SurfaceEndpoint::~SurfaceEndpoint() {
  if (impl_) close();
}

void SurfaceEndpoint::close() noexcept {
  if (impl_->closed || impl_->owner_pid != ::getpid()) return;  // a forked child owns nothing
  impl_->closed = true;
  impl_->set_state(State::kClosing);
  futex_wake(impl_->header.sensors.word);
  impl_->segment.remove();
}

const Description& SurfaceEndpoint::description() const noexcept { return impl_->description; }

std::span<std::byte> SurfaceEndpoint::sensor_bytes(int channel, DType dtype) noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_SENSOR, dtype);
  return impl_->sensors.array(impl_->frame + 1, c);
}

std::span<const std::byte> SurfaceEndpoint::next_bytes(int channel, DType dtype,
                                                       const WaitOptions& options) noexcept {
  return impl_->next_cells(channel, impl_->layout.channel(channel, SSP_ACTUATOR, dtype), options);
}

std::span<const std::byte> SurfaceEndpoint::actuator_bytes(int channel, DType dtype) const noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_ACTUATOR, dtype);
  return impl_->current_cells(c);
}

void SurfaceEndpoint::write_bytes(int channel, DType dtype, std::size_t at,
                                  std::span<const std::byte> values) noexcept {
  const ssp_channel& c = impl_->layout.channel(channel, SSP_SENSOR, dtype);
  assert(at <= c.bytes && values.size() <= c.bytes - at);
  const std::uint64_t next = impl_->frame + 1;
  auto* slot = reinterpret_cast<std::byte*>(&impl_->sensors.slot(next));
  impl_->writer.write(slot, next, c, at, values, is_on_other_core(impl_->header.actuators.cpu));
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

bool SurfaceEndpoint::is_reachable() const noexcept { return impl_->segment.is_in_place(); }
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
  return load_counters(impl_->header.controller);
}
void SurfaceEndpoint::count_clamped(std::uint64_t values) noexcept { impl_->count_clamped(values); }
void SurfaceEndpoint::miss_deadline() noexcept {
  store_relaxed(impl_->header.surface.deadline_misses, ++impl_->counters.deadline_misses);
}

}  // namespace shm_protocol
