#include "smartsurf/run/SurfaceLink.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/scene/Occupancy.h"

namespace smartsurf::run {
namespace {

// None for a regular grid. An empty cell of a free layout stands at the origin; its height there is the
// lowest.
std::vector<std::array<float, 3>> cell_positions(const scene::SurfaceSpec& surface) {
  std::vector<std::array<float, 3>> cells;
  for (std::size_t i = 0; i < surface.cell_poses.size(); ++i)
    cells.push_back({static_cast<float>(surface.cell_poses[i].x), static_cast<float>(surface.cell_poses[i].y),
                     surface.base_heights.empty() ? 0.0F : surface.base_heights[i]});
  return cells;
}

shm_protocol::SurfaceConfig make_surface_config(const std::string& name, RunMode mode,
                                                const scene::SceneSpec& scene) {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = name;
  config.rows = static_cast<std::uint32_t>(scene.surface.rows);
  config.columns = static_cast<std::uint32_t>(scene.surface.columns);
  config.pitch = scene.surface.pitch;
  config.period_ns = static_cast<std::uint64_t>(std::llround(scene.world.control_period_s * 1e9));
  config.mode = mode == RunMode::kTimeStep ? Mode::kTimeStep : Mode::kPassive;
  for (const scene::SensorChannel& channel : scene::collect_channels(scene.surface.sensors))
    config.channels.push_back(
        {channel.name, Direction::kSensor,
         channel.type == scene::SensorChannel::Type::kUint32 ? DType::kU32 : DType::kF32,
         static_cast<std::uint32_t>(channel.components), channel.unit, channel.minimum, channel.maximum,
         channel.no_detection});
  if (scene::has_empty_cells(scene.surface))
    config.channels.push_back(
        {scene::kOccupancyChannel, Direction::kSensor, DType::kF32, 1, "", 0.0, 1.0, 0.0});
  for (const scene::ActuatorChannel& channel : scene.surface.actuator_channels())
    config.channels.push_back({channel.name, Direction::kActuator, DType::kF32, 1, channel.unit,
                               channel.minimum, channel.maximum, channel.safe_value});
  config.positions = cell_positions(scene.surface);
  return config;
}

shm_protocol::SurfaceEndpoint create_endpoint(const shm_protocol::SurfaceConfig& config) {
  try {
    return shm_protocol::SurfaceEndpoint::create(config);
  } catch (const shm_protocol::Error& e) {
    if (e.code() == shm_protocol::ErrorCode::kSystem) throw;
    throw scene::InputError(std::string("--shm: ") + e.what());
  }
}

}  // namespace

SurfaceLink::SurfaceLink(const std::string& name, RunMode mode, const scene::SceneSpec& scene)
    : name_(name),
      mode_(mode),
      endpoint_(create_endpoint(make_surface_config(name, mode, scene))),
      occupancy_(scene::occupancy_mask(scene.surface)),
      // describe() lists the sensors first, and what there is of the cells after them.
      first_actuator_channel_(static_cast<int>(scene.surface.sensor_channels().size()) +
                              (occupancy_.empty() ? 0 : 1)),
      actuator_channel_count_(static_cast<int>(scene.surface.actuator_channels().size())) {}

shm_protocol::Status SurfaceLink::publish(std::uint64_t tick, double time_s,
                                          std::span<const record::ChannelData> sensors) noexcept {
  // The simulation lists its channels in the order in which describe() declared them.
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

shm_protocol::Status SurfaceLink::receive(std::uint64_t tick, std::chrono::nanoseconds timeout,
                                          const std::atomic<bool>& stop) noexcept {
  return mode_ == RunMode::kTimeStep ? endpoint_.await_actuators(tick, {timeout, &stop})
                                     : endpoint_.latest_actuators();
}

}  // namespace smartsurf::run
