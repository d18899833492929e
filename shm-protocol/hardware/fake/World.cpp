#include "shm-protocol/hardware/fake/World.h"

#include <chrono>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace hardware {
namespace {

using shm_protocol::ChannelSpec;
using shm_protocol::Direction;
using shm_protocol::DType;
using shm_protocol::Status;

constexpr std::chrono::seconds kPatience{30};  // for the surface

ssw_channel board_channel(const ChannelSpec& of) {
  ssw_channel c{};
  c.direction = of.direction == Direction::kSensor ? SSW_SENSOR : SSW_ACTUATOR;
  c.dtype = of.dtype == DType::kU8 ? SSW_U8 : SSW_F32;
  c.components = static_cast<std::uint8_t>(of.components);
  c.minimum = static_cast<float>(of.minimum);
  c.maximum = static_cast<float>(of.maximum);
  c.safe = static_cast<float>(of.safe);
  c.scale = 1;
  of.name.copy(c.name, sizeof c.name);
  of.unit.copy(c.unit, sizeof c.unit);
  return c;
}

const std::uint8_t* sensor_bytes(const shm_protocol::ControllerEndpoint& world, int channel, DType dtype) {
  if (dtype == DType::kU8) return world.sensor<std::uint8_t>(channel).data();
  return reinterpret_cast<const std::uint8_t*>(world.sensor<float>(channel).data());
}

std::uint8_t* actuator_bytes(shm_protocol::ControllerEndpoint& world, int channel, DType dtype) {
  if (dtype == DType::kU8) return world.actuator<std::uint8_t>(channel).data();
  return reinterpret_cast<std::uint8_t*>(world.actuator<float>(channel).data());
}

}  // namespace

World::World(const std::string& name, const std::atomic<bool>& stop)
    : endpoint_(shm_protocol::ControllerEndpoint::attach(name, {.timeout = kPatience, .stop = &stop})),
      stop_(stop) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("--world: surface '" + name + "' " + what);
  };
  if (description().mode != shm_protocol::Mode::kTimeStep) refuse("must be in time-step mode");
  if (description().channels.size() > SSW_MAX_CHANNELS)
    refuse("has " + std::to_string(description().channels.size()) + " channels; a board has at most " +
           std::to_string(SSW_MAX_CHANNELS));
  bool moves = false;
  for (const ChannelSpec& c : description().channels) {
    if (c.dtype == DType::kU32) refuse("has the channel '" + c.name + "' of u32, which boards do not send");
    moves = moves || c.direction == Direction::kActuator;
  }
  if (!moves) refuse("has no actuators");
  await();
}

void World::await() {
  const Status status = endpoint_.await_sensors({.stop = &stop_});
  has_ended_ = status == Status::kSurfaceClosed || status == Status::kInterrupted;
  if (status != Status::kOk && !has_ended_)
    throw std::runtime_error("--world: surface '" + description().name + "': " + text(status));
}

void World::step() {
  has_begun_ = has_begun_ || boards_.front()->firmware().in_force != SSW_NONE;
  if (!has_begun_ || has_ended_) return;
  for (WorldDevice* board : boards_) board->command();
  if (endpoint_.publish() == Status::kOk) ++steps_;
  await();
}

WorldDevice::WorldDevice(World& world, std::uint32_t first_row, std::uint32_t first_column,
                         std::uint16_t rows, std::uint16_t columns, Write write)
    : EmulatedDevice("world", rows, columns, static_cast<float>(world.description().pitch), world.period_us(),
                     std::move(write)),
      world_(world),
      first_row_(first_row),
      first_column_(first_column) {
  std::vector<ssd_channel> sensors;
  std::vector<ssw_channel> actuators;
  const auto& channels = world.description().channels;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const ssw_channel c = board_channel(channels[i]);
    const bool is_sensor = channels[i].direction == Direction::kSensor;
    Plane& plane = (is_sensor ? sensors_ : actuators_).emplace_back(static_cast<int>(i));
    if (is_sensor) {
      plane.cells.resize(bytes_of(c));
      sensors.push_back({c, plane.cells.data(), nullptr});
    } else {
      actuators.push_back(c);
    }
  }
  set_channels(std::move(sensors), actuators);
  world.boards_.push_back(this);
}

template <class Visit>
void WorldDevice::for_each_row(const ChannelSpec& c, Visit visit) const {
  const auto& d = world_.description();
  const std::size_t element = element_bytes(c.dtype), bytes = columns_ * element;
  std::size_t of_board = 0;
  for (std::size_t component = 0; component < c.components; ++component)
    for (std::size_t row = 0; row < rows_; ++row, of_board += bytes)
      visit(((component * d.rows + first_row_ + row) * d.columns + first_column_) * element, of_board, bytes);
}

void WorldDevice::sense(std::uint64_t) {
  for (Plane& plane : sensors_) {
    const ChannelSpec& c = world_.description().channels[plane.channel];
    const std::uint8_t* from = sensor_bytes(world_.endpoint_, plane.channel, c.dtype);
    for_each_row(c, [&](std::size_t of_world, std::size_t of_board, std::size_t bytes) {
      std::memcpy(plane.cells.data() + of_board, from + of_world, bytes);
    });
  }
}

void WorldDevice::command() {
  for (std::size_t k = 0; k < actuators_.size(); ++k) {
    const int channel = actuators_[k].channel;
    const ChannelSpec& c = world_.description().channels[channel];
    std::uint8_t* to = actuator_bytes(world_.endpoint_, channel, c.dtype);
    for_each_row(c, [&](std::size_t of_world, std::size_t of_board, std::size_t bytes) {
      std::memcpy(to + of_world, active(k).data() + of_board, bytes);
    });
  }
}

}  // namespace hardware
