#include "apron/run/host/SurfaceHost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

namespace apron::run {

using shm_protocol::ChannelSpec;
using shm_protocol::Direction;
using shm_protocol::DType;
using shm_protocol::Mode;
using shm_protocol::Status;
using vm::HostStatus;

namespace {

// A register's value as the channel carries it. In integer channels values are rounded and clamped, and NaN
// becomes the safe value; float channels pass it on.
template <class T>
T to_channel(float value, const ChannelSpec& channel) {
  if constexpr (std::is_same_v<T, float>) {
    return value;
  } else {
    constexpr double kMax = std::numeric_limits<T>::max();
    const double number = std::isnan(value) ? channel.safe : std::round(double{value});
    return static_cast<T>(std::clamp(number, 0.0, kMax));
  }
}

}  // namespace

SurfaceHost::SurfaceHost(shm_protocol::ControllerEndpoint& surface, const std::atomic<bool>& stop,
                         Parameters parameters, HostEnvironment environment)
    : LocalHost(std::move(parameters), stop, std::move(environment)),
      surface_(surface),
      is_complete_(surface.description().channels.size()) {
  for (const ChannelSpec& channel : surface.description().channels)
    channel_names_.push_back({channel.name, channel.direction == Direction::kSensor, channel.components});
  if (surface.description().mode == Mode::kTimeStep) watchdog_.emplace();
}

HostStatus SurfaceHost::await_first_frame() {
  surface_.set_state(shm_protocol::State::kRunning);
  return await_frame();
}

void SurfaceHost::publish_paused(bool paused) noexcept {
  if (closed_) return;
  surface_.set_state(paused ? shm_protocol::State::kPaused : shm_protocol::State::kRunning);
  if (!watchdog_) return;
  if (paused)
    watchdog_->disarm();
  else
    watchdog_->arm();
}

void SurfaceHost::close() noexcept {
  closed_ = true;
  if (watchdog_) watchdog_->disarm();
  surface_.close();
}

Status SurfaceHost::publish() {
  const std::vector<ChannelSpec>& channels = surface_.description().channels;
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i].direction == Direction::kActuator && !is_complete_[i]) continue_frame(i);
  const Status status = surface_.publish();
  if (status != Status::kOk) return status;  // the frame is still the next one
  has_published_ = true;
  is_complete_.assign(channels.size(), false);
  return status;
}

HostStatus SurfaceHost::await_frame() {
  if (watchdog_) watchdog_->disarm();
  Status status = surface_.await_sensors({.stop = &stop()});
  // A passive surface overwrote the frame while it was copied, and has published a newer one.
  while (status == Status::kTorn && surface_.description().mode == Mode::kPassive)
    status = surface_.await_sensors({.stop = &stop()});
  answered_ = status == Status::kInterrupted;
  if (watchdog_ && status == Status::kOk) watchdog_->arm();
  return to_host_status(status);
}

HostStatus SurfaceHost::step() {
  flush_output();
  if (closed_) return HostStatus::kClosed;
  if (!answered_) {
    notify_before_answer();
    const Status published = publish();
    // kTorn: the surface no longer waits for the answer to this frame, and another frame will follow.
    if (published != Status::kOk && published != Status::kTorn) return to_host_status(published);
  }
  if (surface_.description().mode == Mode::kTimeStep || !free_run_) return await_frame();
  const Status latest = surface_.latest_sensors();
  if (latest != Status::kRepeated && latest != Status::kTorn) return to_host_status(latest);
  std::this_thread::yield();  // no new frame: let the surface run if it shares this core
  return HostStatus::kOk;
}

HostStatus SurfaceHost::to_host_status(Status status) {
  switch (status) {
    case Status::kOk:
      return HostStatus::kOk;
    case Status::kInterrupted:
      return HostStatus::kInterrupted;
    case Status::kSurfaceClosed:
      return HostStatus::kClosed;
    case Status::kSurfaceDead:
      return HostStatus::kPeerLost;
    default:
      return report_status(HostStatus::kFailed,
                           std::string("the exchange with the surface failed: ") + text(status));
  }
}

// ---- channels ---------------------------------------------------------------------------------------------

HostStatus SurfaceHost::resolve_channel(Direction direction, std::string_view name,
                                        library::ChannelComponent& target) {
  std::string error = library::resolve_channel(channel_names_, direction == Direction::kSensor, name, target);
  return error.empty() ? HostStatus::kOk : report_status(HostStatus::kRefused, std::move(error));
}

HostStatus SurfaceHost::check_shape(std::string_view name, const vm::ConstPlane& plane) {
  const shm_protocol::Description& surface = surface_.description();
  if (plane.width == surface.columns && plane.height == surface.rows) return HostStatus::kOk;
  return report_status(HostStatus::kRefused,
                       fmt::format("channel '{}' is {}x{}, but the register is {}", name, surface.columns,
                                   surface.rows, vm::format_shape(plane)));
}

bool SurfaceHost::has(std::string_view channel) const {
  return library::has_channel(channel_names_, channel);
}

std::optional<double> SurfaceHost::time_s() const { return surface_.sensor_info().time_s; }
std::optional<double> SurfaceHost::dt_s() const {
  return static_cast<double>(surface_.description().period_ns) * 1e-9;
}
std::optional<double> SurfaceHost::tick() const { return static_cast<double>(surface_.sensor_info().tick); }

// ---- frames -----------------------------------------------------------------------------------------------

template <class T>
void SurfaceHost::copy_sensor(const library::ChannelComponent& target, const vm::Plane& to) const {
  const T* from = surface_.sensor<T>(target.channel).data() + target.component * to.cell_count();
  for (std::uint32_t y = 0; y < to.height; ++y, from += to.width)
    std::transform(from, from + to.width, to.row(y), [](T value) { return static_cast<float>(value); });
}

HostStatus SurfaceHost::sense(std::string_view channel, vm::Plane to) {
  library::ChannelComponent target;
  // The program was restarted during an interrupted step(): the answered frame may no longer be read.
  HostStatus status = answered_ ? await_frame() : HostStatus::kOk;
  if (status == HostStatus::kOk) status = resolve_channel(Direction::kSensor, channel, target);
  if (status == HostStatus::kOk) status = check_shape(channel, to);
  if (status != HostStatus::kOk) return status;
  shm_protocol::with_element_type(surface_.description().channels[target.channel].dtype,
                                  [&]<class T>(T) { copy_sensor<T>(target, to); });
  return HostStatus::kOk;
}

void SurfaceHost::continue_frame(std::size_t channel) {
  const ChannelSpec& spec = surface_.description().channels[channel];
  shm_protocol::with_element_type(spec.dtype, [&]<class T>(T) {
    const std::span<T> next = surface_.actuator<T>(channel);
    if (has_published_)
      std::ranges::copy(surface_.published_actuator<T>(channel), next.begin());
    else
      std::ranges::fill(next, to_channel<T>(static_cast<float>(spec.safe), spec));
  });
}

template <class Write>
HostStatus SurfaceHost::write_plane(std::string_view name, const vm::ConstPlane* shape, Write write) {
  if (closed_) return HostStatus::kClosed;
  library::ChannelComponent target;
  HostStatus status = resolve_channel(Direction::kActuator, name, target);
  if (status == HostStatus::kOk && shape != nullptr) status = check_shape(name, *shape);
  if (status != HostStatus::kOk) return status;
  const ChannelSpec& channel = surface_.description().channels[target.channel];
  // The other components continue, until the program writes them too.
  if (!is_complete_[target.channel] && channel.components > 1) continue_frame(target.channel);
  is_complete_[target.channel] = true;
  shm_protocol::with_element_type(channel.dtype, [&]<class T>(T) {
    write(surface_.actuator<T>(target.channel).data() + target.component * surface_.description().cells(),
          channel);
  });
  return HostStatus::kOk;
}

HostStatus SurfaceHost::actuate(std::string_view channel, vm::ConstPlane from) {
  return write_plane(channel, &from, [&]<class T>(T* to, const ChannelSpec& spec) {
    for (std::uint32_t y = 0; y < from.height; ++y, to += from.width)
      std::transform(from.row(y), from.row(y) + from.width, to,
                     [&](float value) { return to_channel<T>(value, spec); });
  });
}

HostStatus SurfaceHost::actuate(std::string_view channel, float value) {
  return write_plane(channel, nullptr, [&]<class T>(T* to, const ChannelSpec& spec) {
    std::fill_n(to, surface_.description().cells(), to_channel<T>(value, spec));
  });
}

}  // namespace apron::run
