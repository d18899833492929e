#include "apron/run/host/SurfaceHost.h"

#include <algorithm>
#include <cassert>
#include <charconv>
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

// Parses "[k]", or ".r", ".g" and ".b" of a channel with three components.
bool parse_component(std::string_view suffix, std::uint32_t components, std::size_t& component) {
  constexpr std::string_view kColours = "rgb";
  if (suffix.size() == 2 && suffix[0] == '.' && components == 3) {
    component = kColours.find(suffix[1]);
    return component != std::string_view::npos;
  }
  if (suffix.size() < 3 || suffix.front() != '[' || suffix.back() != ']') return false;
  const char* const end = suffix.data() + suffix.size() - 1;
  const auto [next, error] = std::from_chars(suffix.data() + 1, end, component);
  return error == std::errc{} && next == end && component < components;
}

}  // namespace

SurfaceHost::SurfaceHost(shm_protocol::ControllerEndpoint& surface, const std::atomic<bool>& stop,
                         Parameters parameters, HostEnvironment environment)
    : LocalHost(std::move(parameters), stop, std::move(environment)), surface_(surface) {
  const std::vector<ChannelSpec>& channels = surface_.description().channels;
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i].direction == Direction::kActuator)
      staged_.push_back(
          {static_cast<int>(i), std::vector<float>(surface_.description().cells() * channels[i].components,
                                                   static_cast<float>(channels[i].safe))});
}

HostStatus SurfaceHost::await_first_frame() {
  surface_.set_state(shm_protocol::State::kRunning);
  return to_host_status(surface_.await_sensors({.stop = &stop()}));
}

void SurfaceHost::publish_paused(bool paused) noexcept {
  surface_.set_state(paused ? shm_protocol::State::kPaused : shm_protocol::State::kRunning);
}

Status SurfaceHost::publish_staged() {
  for (const StagedFrame& staged : staged_) {
    switch (surface_.description().channels[static_cast<std::size_t>(staged.channel)].dtype) {
      case DType::kF32:
        send<float>(staged);
        break;
      case DType::kU32:
        send<std::uint32_t>(staged);
        break;
      case DType::kU8:
        send<std::uint8_t>(staged);
        break;
    }
  }
  return surface_.publish();
}

HostStatus SurfaceHost::await_frame() {
  const Status status = surface_.await_sensors({.stop = &stop()});
  published_ = status == Status::kInterrupted;
  return to_host_status(status);
}

HostStatus SurfaceHost::step() {
  flush_output();
  if (!published_) {
    const Status published = publish_staged();
    // kTorn: the surface no longer waits for the answer to this frame, and another frame will follow.
    if (published != Status::kOk && published != Status::kTorn) return to_host_status(published);
  }
  if (surface_.description().mode == Mode::kTimeStep) {
    return await_frame();
  }
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

// A channel's own name may contain a dot, so the whole name is looked up before it is split.
HostStatus SurfaceHost::resolve_channel(Direction direction, std::string_view name,
                                        ChannelComponent& target) {
  std::string_view channel = name;
  std::string_view component;
  target.channel = surface_.description().channel(direction, std::string(channel));
  if (target.channel < 0) {
    const std::size_t bracket = name.find('['),
                      suffix_start = bracket != name.npos ? bracket : name.rfind('.');
    if (suffix_start != std::string_view::npos)
      channel = name.substr(0, suffix_start), component = name.substr(suffix_start);
    target.channel = surface_.description().channel(direction, std::string(channel));
  }
  if (target.channel < 0)
    return report_status(HostStatus::kRefused, unknown_channel_message(direction, channel));
  const std::uint32_t components =
      surface_.description().channels[static_cast<std::size_t>(target.channel)].components;
  if (component.empty() ? components == 1 : parse_component(component, components, target.component))
    return HostStatus::kOk;
  if (components == 1)
    return report_status(HostStatus::kRefused, "channel '" + std::string(channel) +
                                                   "' has one component per cell, not '" + std::string(name) +
                                                   "': write '" + std::string(channel) + "'");
  return report_status(HostStatus::kRefused, "channel '" + std::string(channel) + "' has " +
                                                 std::to_string(components) + " components per cell, not '" +
                                                 std::string(name) + "': write '" + std::string(channel) +
                                                 "[0]' to '" + std::string(channel) + "[" +
                                                 std::to_string(components - 1) + "]'");
}

std::string SurfaceHost::unknown_channel_message(Direction direction, std::string_view name) const {
  const std::string kind = direction == Direction::kSensor ? "sensor" : "actuator";
  std::string list;
  for (const ChannelSpec& c : surface_.description().channels)
    if (c.direction == direction) list += (list.empty() ? "" : ", ") + c.name;
  std::string message("the surface has no ");
  message += kind;
  message += " channel '";
  message += name;
  message += "'; ";
  return message += list.empty() ? "it has no " + kind + " channels" : "its " + kind + " channels: " + list;
}

HostStatus SurfaceHost::check_shape(std::string_view name, const vm::ConstPlane& plane) {
  const shm_protocol::Description& surface = surface_.description();
  if (plane.width == surface.columns && plane.height == surface.rows) return HostStatus::kOk;
  return report_status(HostStatus::kRefused,
                       "channel '" + std::string(name) + "' is " + std::to_string(surface.columns) + "x" +
                           std::to_string(surface.rows) + ", but the register is " + vm::format_shape(plane));
}

bool SurfaceHost::has(std::string_view channel) const {
  const std::string name(channel);
  return surface_.description().channel(Direction::kSensor, name) >= 0 ||
         surface_.description().channel(Direction::kActuator, name) >= 0;
}

std::optional<double> SurfaceHost::time_s() const { return surface_.sensor_info().time_s; }
std::optional<double> SurfaceHost::dt_s() const {
  return static_cast<double>(surface_.description().period_ns) * 1e-9;
}
std::optional<double> SurfaceHost::tick() const { return static_cast<double>(surface_.sensor_info().tick); }

// ---- frames -----------------------------------------------------------------------------------------------

template <class T>
void SurfaceHost::copy_sensor(const ChannelComponent& target, const vm::Plane& to) const {
  const T* from = surface_.sensor<T>(target.channel).data() + target.component * to.cell_count();
  for (std::uint32_t y = 0; y < to.height; ++y, from += to.width)
    std::transform(from, from + to.width, to.row(y), [](T value) { return static_cast<float>(value); });
}

HostStatus SurfaceHost::sense(std::string_view channel, vm::Plane to) {
  ChannelComponent target;
  // The program was restarted during an interrupted step(): the answered frame may no longer be read.
  HostStatus status = published_ ? await_frame() : HostStatus::kOk;
  if (status == HostStatus::kOk) status = resolve_channel(Direction::kSensor, channel, target);
  if (status == HostStatus::kOk) status = check_shape(channel, to);
  if (status != HostStatus::kOk) return status;
  switch (surface_.description().channels[static_cast<std::size_t>(target.channel)].dtype) {
    case DType::kF32:
      copy_sensor<float>(target, to);
      break;
    case DType::kU32:
      copy_sensor<std::uint32_t>(target, to);
      break;
    case DType::kU8:
      copy_sensor<std::uint8_t>(target, to);
      break;
  }
  return HostStatus::kOk;
}

float* SurfaceHost::staged_plane(const ChannelComponent& target) {
  const auto found = std::find_if(staged_.begin(), staged_.end(),
                                  [&](const StagedFrame& s) { return s.channel == target.channel; });
  assert(found != staged_.end());
  return found->cells.data() + target.component * surface_.description().cells();
}

HostStatus SurfaceHost::actuate(std::string_view channel, vm::ConstPlane from) {
  ChannelComponent target;
  HostStatus status = resolve_channel(Direction::kActuator, channel, target);
  if (status == HostStatus::kOk) status = check_shape(channel, from);
  if (status != HostStatus::kOk) return status;
  float* to = staged_plane(target);
  for (std::uint32_t y = 0; y < from.height; ++y) to = std::copy_n(from.row(y), from.width, to);
  return HostStatus::kOk;
}

HostStatus SurfaceHost::actuate(std::string_view channel, float value) {
  ChannelComponent target;
  const HostStatus status = resolve_channel(Direction::kActuator, channel, target);
  if (status != HostStatus::kOk) return status;
  std::fill_n(staged_plane(target), surface_.description().cells(), value);
  return HostStatus::kOk;
}

template <class T>
void SurfaceHost::send(const StagedFrame& staged) {
  if constexpr (std::is_same_v<T, float>) {
    surface_.write(staged.channel, 0, std::span<const float>(staged.cells));
  } else {
    const auto to = surface_.actuator<T>(staged.channel);
    const ChannelSpec& channel = surface_.description().channels[static_cast<std::size_t>(staged.channel)];
    constexpr double kMax = std::numeric_limits<T>::max();
    std::transform(staged.cells.begin(), staged.cells.end(), to.begin(), [&](float value) {
      const double number = std::isnan(value) ? channel.safe : std::round(double{value});
      return static_cast<T>(std::clamp(number, 0.0, kMax));
    });
  }
}

}  // namespace apron::run
