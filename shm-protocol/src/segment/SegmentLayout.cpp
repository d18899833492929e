#include "SegmentLayout.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "ProcessIdentity.h"
#include "shm_protocol/Array.h"
#include "shm_protocol/Error.h"

namespace shm_protocol {
namespace {

constexpr std::uint32_t kMaxExtent = 65536;
constexpr std::uint32_t kMaxComponents = 64;

[[noreturn]] void reject_config(const std::string& reason) { throw Error(ErrorCode::kBadConfig, reason); }

std::uint64_t round_up(std::uint64_t value, std::uint64_t unit) { return (value + unit - 1) / unit * unit; }

// The text in quotes, with control characters as '?', so that it is safe on a terminal.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c >= ' ' && c <= '~' ? c : '?';
  return out + "\"";
}

bool is_valid_name(const std::string& text, std::size_t max_length) {
  const auto allowed = [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !text.empty() && text.size() <= max_length && text[0] != '.' &&
         std::all_of(text.begin(), text.end(), allowed);
}

void check_range(const ChannelSpec& c, const std::string& where) {
  const auto [lowest, highest] = dtype_limits(c.dtype);
  const bool whole =
      c.dtype == DType::kF32 || (std::floor(c.minimum) == c.minimum && std::floor(c.maximum) == c.maximum &&
                                 std::floor(c.safe) == c.safe);
  // Written so that a NaN fails.
  if (!(c.minimum >= lowest && c.minimum <= c.maximum && c.maximum <= highest) || !whole)
    reject_config(where + "range " + std::to_string(c.minimum) + " … " + std::to_string(c.maximum) +
                  ": must be ascending, finite and within what " + text(c.dtype) + " holds");
  if (!(c.safe >= c.minimum && c.safe <= c.maximum))
    reject_config(where + "safe value " + std::to_string(c.safe) + ": must lie within the channel's range");
}

void check_channel(const ChannelSpec& c) {
  const std::string where = "channel " + quoted(c.name) + ": ";
  if (!is_valid_name(c.name, sizeof(ssp_channel::name) - 1))
    reject_config(where + "a name has 1 to 31 of A-Z a-z 0-9 _ . - and does not begin with a dot");
  if (c.unit.size() >= sizeof(ssp_channel::unit) || c.unit.find('\0') != std::string::npos)
    reject_config(where + "unit " + quoted(c.unit) + ": at most 15 characters");
  if (c.direction != Direction::kSensor && c.direction != Direction::kActuator)
    reject_config(where + "unknown direction");
  if (c.dtype != DType::kF32 && c.dtype != DType::kU32 && c.dtype != DType::kU8)
    reject_config(where + "unknown dtype");
  if (c.components < 1 || c.components > kMaxComponents)
    reject_config(where + "components = " + std::to_string(c.components) + ": must be 1 to 64");
  check_range(c, where);
}

void check_config(const SurfaceConfig& config) {
  check_name(config.name);
  for (const auto& [field, value] : {std::pair{"rows", config.rows}, std::pair{"columns", config.columns}})
    if (value < 1 || value > kMaxExtent)
      reject_config(std::string(field) + " = " + std::to_string(value) + ": must be 1 to 65536");
  if (!(config.pitch > 0.0) || !std::isfinite(config.pitch))
    reject_config("pitch = " + std::to_string(config.pitch) + ": must be finite and greater than 0");
  if (config.period_ns == 0) reject_config("period_ns = 0: must be greater than 0");
  if (config.mode != Mode::kTimeStep && config.mode != Mode::kPassive) reject_config("unknown mode");
  if (config.channels.empty() || config.channels.size() > SSP_MAX_CHANNELS)
    reject_config("channels: there are " + std::to_string(config.channels.size()) + "; must be 1 to 32");
  if (!std::has_single_bit(config.slots) || config.slots < SSP_MIN_SLOTS || config.slots > SSP_MAX_SLOTS)
    reject_config("slots = " + std::to_string(config.slots) + ": must be 4, 8, 16, 32 or 64");
  if (!config.positions.empty() && config.positions.size() != std::size_t{config.rows} * config.columns)
    reject_config("positions: there are " + std::to_string(config.positions.size()) +
                  "; must be one for each cell, or none");
  for (auto c = config.channels.begin(); c != config.channels.end(); ++c) {
    check_channel(*c);
    const auto same = [&](const ChannelSpec& d) { return d.direction == c->direction && d.name == c->name; };
    if (std::any_of(config.channels.begin(), c, same))
      reject_config("channel \"" + c->name + "\": named twice");
  }
}

// Assigns consecutive offsets to the channels of one direction; returns the slot size.
std::uint64_t assign_slot_offsets(std::vector<ssp_channel>& channels, Direction direction) {
  std::uint64_t end = sizeof(ssp_slot);
  for (auto& c : channels) {
    if (c.direction != static_cast<std::uint32_t>(direction)) continue;
    c.offset = round_up(end, SSP_ARRAY_ALIGNMENT);
    end = c.offset + c.bytes;
  }
  return round_up(end, SSP_LINE);
}

ssp_channel make_directory_entry(const ChannelSpec& spec, std::uint64_t cells) {
  ssp_channel c{};
  std::memcpy(c.name, spec.name.data(), spec.name.size());
  std::memcpy(c.unit, spec.unit.data(), spec.unit.size());
  c.direction = static_cast<std::uint32_t>(spec.direction);
  c.dtype = static_cast<std::uint32_t>(spec.dtype);
  c.components = spec.components;
  c.minimum = spec.minimum;
  c.maximum = spec.maximum;
  c.safe = spec.safe;
  c.bytes = cells * spec.components * element_bytes(spec.dtype);
  return c;
}

std::size_t array_bytes(std::uint64_t slot_bytes) {
  return static_cast<std::size_t>(slot_bytes) - sizeof(ssp_slot);
}

}  // namespace

std::size_t SegmentLayout::sensor_array_bytes() const noexcept {
  return array_bytes(geometry.sensor_slot_bytes);
}
std::size_t SegmentLayout::actuator_array_bytes() const noexcept {
  return array_bytes(geometry.actuator_slot_bytes);
}

std::pair<double, double> dtype_limits(DType dtype) noexcept {
  constexpr double kFloat = std::numeric_limits<float>::max();
  if (dtype == DType::kF32) return {-kFloat, kFloat};
  return {0.0, dtype == DType::kU32 ? 4294967295.0 : 255.0};
}

void fill_safe(std::span<std::byte> array, const ssp_channel& c) noexcept {
  with_element_type(static_cast<DType>(c.dtype),
                    [&]<class T>(T) { std::ranges::fill(as_array<T>(array), static_cast<T>(c.safe)); });
}

void check_name(const std::string& name) {
  if (!is_valid_name(name, 48))
    reject_config("name " + quoted(name) + ": must be 1 to 48 of A-Z a-z 0-9 _ . - and not begin with a dot");
}

std::uint64_t layout_hash(const ssp_geometry& geometry, std::span<const std::byte> directory) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325;
  const auto add = [&](std::span<const std::byte> bytes) {
    for (const std::byte b : bytes) hash = (hash ^ static_cast<std::uint8_t>(b)) * 0x100000001B3;
  };
  add(std::as_bytes(std::span(&geometry, 1)));
  add(directory);
  return hash;
}

SegmentLayout plan_layout(const SurfaceConfig& config) {
  check_config(config);
  SegmentLayout out;
  const std::uint64_t cells = std::uint64_t{config.rows} * config.columns;
  for (const auto& spec : config.channels) out.channels.push_back(make_directory_entry(spec, cells));

  ssp_geometry& g = out.geometry;
  g.rows = config.rows;
  g.columns = config.columns;
  g.pitch = config.pitch;
  g.channel_count = static_cast<std::uint32_t>(out.channels.size());
  g.channel_bytes = sizeof(ssp_channel);
  g.channels_offset = sizeof(ssp_header);
  g.slot_header_bytes = sizeof(ssp_slot);
  g.sensor_slots = g.actuator_slots = config.slots;
  std::uint64_t end = g.channels_offset + SSP_MAX_CHANNELS * sizeof(ssp_channel);
  if (!config.positions.empty()) {
    g.position_components = 3;
    g.positions_offset = end;
    end = round_up(end + cells * 3 * sizeof(float), 4096);
  }
  g.sensor_slot_bytes = assign_slot_offsets(out.channels, Direction::kSensor);
  g.actuator_slot_bytes = assign_slot_offsets(out.channels, Direction::kActuator);
  g.sensor_ring_offset = end;
  g.actuator_ring_offset = round_up(end + g.sensor_slots * g.sensor_slot_bytes, 4096);

  ssp_identity& id = out.identity;
  id.magic = SSP_MAGIC;
  id.version = SSP_VERSION;
  id.header_bytes = sizeof(ssp_header);
  id.segment_bytes = round_up(g.actuator_ring_offset + g.actuator_slots * g.actuator_slot_bytes, 4096);
  id.layout_hash = layout_hash(g, std::as_bytes(std::span(out.channels)));
  id.dt_ns = config.period_ns;
  id.mode = static_cast<std::uint32_t>(config.mode);
  std::memcpy(id.name, config.name.data(), config.name.size());
  return out;
}

void write_layout(const SegmentLayout& layout, const SurfaceConfig& config, std::span<std::byte> segment) {
  const ssp_geometry& g = layout.geometry;
  auto& header = *reinterpret_cast<ssp_header*>(segment.data());
  header.identity = layout.identity;
  header.identity.version = 0;
  header.geometry = g;
  header.sensors.cpu = header.actuators.cpu = SSP_CPU_UNKNOWN;
  std::memcpy(&segment[g.channels_offset], layout.channels.data(),
              layout.channels.size() * sizeof(ssp_channel));
  if (g.positions_offset)
    std::memcpy(&segment[g.positions_offset], config.positions.data(),
                config.positions.size() * sizeof(float[3]));
  for (const auto& c : layout.channels) {
    const bool sensor = c.direction == SSP_SENSOR;
    const std::uint64_t ring = sensor ? g.sensor_ring_offset : g.actuator_ring_offset;
    const std::uint64_t slot = sensor ? g.sensor_slot_bytes : g.actuator_slot_bytes;
    for (std::uint64_t s = 0; s < (sensor ? g.sensor_slots : g.actuator_slots); ++s)
      fill_safe(segment.subspan(ring + s * slot + c.offset, c.bytes), c);
  }
}

Description describe(const SegmentLayout& layout, std::span<const std::byte> segment) {
  const ssp_geometry& g = layout.geometry;
  Description d;
  d.name = layout.identity.name;
  d.version_major = static_cast<std::uint16_t>(layout.identity.version >> 16);
  d.version_minor = static_cast<std::uint16_t>(layout.identity.version & 0xFFFF);
  d.session = layout.identity.session;
  d.layout_hash = layout.identity.layout_hash;
  d.rows = g.rows;
  d.columns = g.columns;
  d.pitch = g.pitch;
  d.period_ns = layout.identity.dt_ns;
  d.mode = static_cast<Mode>(layout.identity.mode);
  d.surface_pid = pid_of(layout.identity.surface_process);
  for (const auto& c : layout.channels)
    d.channels.push_back({c.name, static_cast<Direction>(c.direction), static_cast<DType>(c.dtype),
                          c.components, c.unit, c.minimum, c.maximum, c.safe});
  if (g.positions_offset) {
    d.positions.resize(d.cells());
    std::memcpy(d.positions.data(), &segment[g.positions_offset], d.cells() * sizeof(float[3]));
  }
  return d;
}

}  // namespace shm_protocol
