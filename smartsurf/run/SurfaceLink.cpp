#include "smartsurf/run/SurfaceLink.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "shm_protocol/layout.h"
#include "smartsurf/scene/ChannelName.h"

namespace smartsurf::run {
namespace {

// Actuator frames of at least this many bytes are received in chunks.
constexpr std::size_t kMinStreamedBytes = 64 * 1024;

static_assert(sizeof(ssp_channel::name) == scene::kMaxChannelNameLength + 1 &&
              sizeof(ssp_channel::unit) == scene::kMaxChannelUnitLength + 1);

// Empty for a regular grid at height 0; else x, y and base height of each cell, u.
std::vector<std::array<float, 3>> cell_positions(const scene::SurfaceSpec& surface) {
  std::vector<std::array<float, 3>> cells;
  if (surface.cell_poses.empty() &&
      std::ranges::all_of(surface.base_heights, [](float z) { return z == 0.0F; }))
    return cells;
  cells.reserve(surface.cell_count());
  for (int row = 0; row < surface.rows; ++row)
    for (int column = 0; column < surface.columns; ++column) {
      const Eigen::Vector2f at = surface.centre(row, column).cast<float>();
      cells.push_back({at.x(), at.y(), surface.base_height(surface.index(row, column))});
    }
  return cells;
}

shm_protocol::SurfaceConfig make_surface_config(const std::string& name, RunMode mode,
                                                const scene::SceneSpec& scene,
                                                std::shared_ptr<shm_protocol::SurfaceName> reserved) {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = name;
  config.rows = static_cast<std::uint32_t>(scene.surface.rows);
  config.columns = static_cast<std::uint32_t>(scene.surface.columns);
  config.pitch = scene.surface.pitch;
  config.period_ns = static_cast<std::uint64_t>(std::llround(scene.world.control_period_s * 1e9));
  config.mode = mode == RunMode::kTimeStep ? Mode::kTimeStep : Mode::kPassive;
  for (const scene::SensorChannel& channel : scene.surface.observed_channels())
    config.channels.push_back(
        {channel.name, Direction::kSensor,
         channel.type == scene::SensorChannel::Type::kUint32 ? DType::kU32 : DType::kF32,
         static_cast<std::uint32_t>(channel.components), channel.unit, channel.minimum, channel.maximum,
         channel.no_detection});
  for (const scene::ActuatorChannel& channel : scene.surface.actuator_channels())
    config.channels.push_back({channel.name, Direction::kActuator, DType::kF32, 1, channel.unit,
                               channel.minimum, channel.maximum, channel.safe_value});
  config.answers_in_place = true;  // the actuators copy and check the values
  config.positions = cell_positions(scene.surface);
  config.reserved = std::move(reserved);
  return config;
}

// Calls a function of the protocol that takes the surface's name.
auto with_name(const auto& function) {
  try {
    return function();
  } catch (const shm_protocol::Error& e) {
    if (e.code() == shm_protocol::ErrorCode::kSystem) throw;
    throw scene::InputError(std::string("--shm: ") + e.what());
  }
}

shm_protocol::SurfaceEndpoint create_endpoint(const shm_protocol::SurfaceConfig& config) {
  return with_name([&] { return shm_protocol::SurfaceEndpoint::create(config); });
}

}  // namespace

std::shared_ptr<shm_protocol::SurfaceName> reserve_name(const std::string& name) {
  return with_name([&] { return std::make_shared<shm_protocol::SurfaceName>(name); });
}

SurfaceLink::SurfaceLink(const std::string& name, RunMode mode, const scene::SceneSpec& scene,
                         std::shared_ptr<shm_protocol::SurfaceName> reserved)
    : name_(name),
      mode_(mode),
      segment_("/dev/shm/smartsurf." + name),
      endpoint_(create_endpoint(make_surface_config(name, mode, scene, std::move(reserved)))),
      occupancy_(scene.surface.occupancy()),
      // make_surface_config() lists the sensors first, then the occupancy, then the actuators.
      first_actuator_channel_(static_cast<int>(scene.surface.observed_channels().size())),
      received_(scene.surface.actuator_channels().size(), 0),
      streams_(received_.size() * scene.surface.cell_count() * sizeof(float) >= kMinStreamedBytes) {}

shm_protocol::Status SurfaceLink::publish(std::uint64_t tick, double time_s,
                                          std::span<const scene::ChannelData> sensors) noexcept {
  // The simulation lists its channels in the order of make_surface_config().
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const int channel = static_cast<int>(i);
    if (endpoint_.description().channels[i].dtype == shm_protocol::DType::kU32)
      std::ranges::transform(sensors[i].values, endpoint_.sensor<std::uint32_t>(channel).begin(),
                             [](float value) { return static_cast<std::uint32_t>(value); });
    else
      endpoint_.write(channel, 0, std::span<const float>(sensors[i].values));
  }
  if (!occupancy_.empty())
    endpoint_.write(static_cast<int>(sensors.size()), 0, std::span<const float>(occupancy_));
  return endpoint_.publish(tick, time_s);
}

void SurfaceLink::receive_chunks(surface::ActuatorArray& actuators,
                                 const shm_protocol::WaitOptions& options) noexcept {
  for (std::size_t i = 0; i < received_.size(); ++i) {
    const int channel = static_cast<int>(i);
    for (auto cells = endpoint_.next_cells(first_actuator_channel_ + channel, options); !cells.empty();
         cells = endpoint_.next_cells(first_actuator_channel_ + channel, options)) {
      endpoint_.count_clamped(actuators.set_targets(channel, cells, received_[i]));
      received_[i] += static_cast<int>(cells.size());
    }
  }
}

shm_protocol::Status SurfaceLink::receive(std::uint64_t tick, std::chrono::nanoseconds timeout,
                                          const std::atomic<bool>& stop,
                                          surface::ActuatorArray& actuators) noexcept {
  using shm_protocol::Status;
  const shm_protocol::WaitOptions options{timeout, &stop};
  Status status;
  if (mode_ == RunMode::kTimeStep) {
    if (streams_) receive_chunks(actuators, options);
    status = endpoint_.await_actuators(tick, options);
  } else {
    status = endpoint_.latest_actuators();
  }
  if (status == Status::kOk)
    for (std::size_t i = 0; i < received_.size(); ++i) {
      const int channel = static_cast<int>(i);
      const auto cells = endpoint_.actuator<float>(first_actuator_channel_ + channel);
      const std::size_t done = received_[i];
      if (done < cells.size())
        endpoint_.count_clamped(actuators.set_targets(channel, cells.subspan(done), received_[i]));
    }
  if (status != Status::kTimeout && status != Status::kInterrupted) std::ranges::fill(received_, 0);
  return status;
}

}  // namespace smartsurf::run
