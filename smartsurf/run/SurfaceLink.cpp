#include "smartsurf/run/SurfaceLink.h"

#include <cmath>

namespace smartsurf::run {
namespace {

shm_protocol::SurfaceConfig describe(const std::string& name, RunMode mode, const scene::SceneSpec& scene) {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = name;
  config.rows = static_cast<std::uint32_t>(scene.surface.rows);
  config.columns = static_cast<std::uint32_t>(scene.surface.columns);
  config.pitch = scene.surface.pitch;
  config.period_ns = static_cast<std::uint64_t>(std::llround(scene.world.control_period_s * 1e9));
  config.mode = mode == RunMode::kTimeStep ? Mode::kTimeStep : Mode::kPassive;
  const std::vector<std::string> names = scene.surface.sensor_channels();
  for (std::size_t i = 0; i < scene.surface.sensors.size(); ++i) {
    const double range = scene.surface.sensors[i].range;
    config.channels.push_back({names[2 * i], Direction::kSensor, DType::kF32, 1, "u", 0.0, range, range});
    config.channels.push_back({names[2 * i + 1], Direction::kSensor, DType::kF32, 1, "", 0.0, 1.0, 0.0});
  }
  const auto& pin = scene.surface.pin;
  config.channels.push_back(
      {"height", Direction::kActuator, DType::kF32, 1, "u", pin.min_height, pin.max_height, pin.min_height});
  return config;
}

shm_protocol::SurfaceEndpoint open(const shm_protocol::SurfaceConfig& config) {
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
      endpoint_(open(describe(name, mode, scene))),
      height_channel_(endpoint_.description().channel(shm_protocol::Direction::kActuator, "height")) {}

shm_protocol::Status SurfaceLink::publish(std::uint64_t tick, double time_s,
                                          std::span<const record::Channel> sensors) noexcept {
  // The simulation lists its channels in the order in which describe() declared them.
  for (std::size_t i = 0; i < sensors.size(); ++i)
    endpoint_.write(static_cast<int>(i), 0, std::span<const float>(sensors[i].values));
  return endpoint_.publish(tick, time_s);
}

shm_protocol::Status SurfaceLink::receive(std::uint64_t tick, std::chrono::nanoseconds patience,
                                          const std::atomic<bool>& stop) noexcept {
  return mode_ == RunMode::kTimeStep ? endpoint_.await_actuators(tick, {patience, &stop})
                                     : endpoint_.latest_actuators();
}

}  // namespace smartsurf::run
