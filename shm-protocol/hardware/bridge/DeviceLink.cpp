#include "shm-protocol/hardware/bridge/DeviceLink.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

#include "common/text/Printable.h"

namespace hardware {
namespace {

constexpr std::size_t kMaxElements = std::size_t{1} << 24;

// Made printable here, where the device says it: the bridge prints, publishes and records it.
template <std::size_t N>
std::string text_of(const char (&padded)[N]) {
  return common::printable({padded, ::strnlen(padded, N)});
}

std::string number(float value) { return std::to_string(value); }

std::string short_number(float value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%g", static_cast<double>(value));
  return digits;
}

// Returns the error, or "" if the raw numbers of the actuator's channel can express what it describes.
std::string validate_raw_range(const ssw_channel& c) {
  const float most = ssw_most_raw(c.dtype);
  const std::string possible = std::string("the ") + (c.dtype == SSW_U16 ? "u16" : "u8") + " of scale " +
                               short_number(c.scale) + " reach from " + short_number(c.offset) + " to " +
                               short_number(c.offset + c.scale * most);
  for (const auto& [field, value] :
       {std::pair{"minimum", c.minimum}, {"maximum", c.maximum}, {"safe value", c.safe}}) {
    const float raw = (value - c.offset) / c.scale, error = ssw_raw_error(&c, value);
    if (!(raw >= -error && raw <= most + error))
      return std::string("the ") + field + " " + short_number(value) + " cannot be expressed: " + possible;
  }
  if (const ssw_raw_range range = ssw_get_raw_range(&c); range.lowest > range.highest)
    return "the range " + short_number(c.minimum) + " … " + short_number(c.maximum) +
           " has no value that can be expressed: " + possible;
  return {};
}

// Returns the error, or "" if the channel is valid.
std::string validate_channel(const ssw_channel& c) {
  if (c.direction != SSW_SENSOR && c.direction != SSW_ACTUATOR) return "unknown direction";
  if (ssw_dtype_bytes(c.dtype) == 0) return "unknown dtype";
  if (c.components < 1 || c.components > 64) return "1 to 64 components are possible";
  if (!std::isfinite(c.minimum) || !std::isfinite(c.maximum) || !(c.minimum < c.maximum))
    return "the range " + number(c.minimum) + " … " + number(c.maximum) + " is not one";
  if (!(c.safe >= c.minimum && c.safe <= c.maximum)) return "the safe value lies outside the range";
  if (!std::isfinite(c.scale) || !(c.scale > 0))
    return "the scale " + number(c.scale) + " must be finite and above 0";
  if (!std::isfinite(c.offset)) return "the offset " + number(c.offset) + " must be finite";
  if (c.dtype == SSW_F32 && (c.scale != 1 || c.offset != 0)) return "an f32 channel has scale 1 and offset 0";
  return c.direction == SSW_ACTUATOR && c.dtype != SSW_F32 ? validate_raw_range(c) : "";
}

float value_at(const DeviceChannel& c, const std::uint8_t* from) {
  switch (c.dtype) {
    case SSW_F32:
      return ssw_get_f32(from);
    case SSW_U16:
      return c.offset + c.scale * static_cast<float>(ssw_get_u16(from));
    default:
      return c.offset + c.scale * static_cast<float>(*from);
  }
}

float within(const DeviceChannel& c, float value) {
  return std::isnan(value) ? c.safe : std::clamp(value, c.minimum, c.maximum);
}

ssw_raw_range raw_range(const DeviceChannel& c) {
  ssw_channel channel{};
  channel.dtype = c.dtype;
  channel.minimum = c.minimum;
  channel.maximum = c.maximum;
  channel.scale = c.scale;
  channel.offset = c.offset;
  return ssw_get_raw_range(&channel);
}

// The nearest raw number within the range.
float raw_value(const DeviceChannel& c, const ssw_raw_range& range, float value) {
  return std::clamp(std::round((within(c, value) - c.offset) / c.scale), range.lowest, range.highest);
}

void put_value(const DeviceChannel& c, const ssw_raw_range& range, float value, std::uint8_t* to) {
  if (c.dtype == SSW_F32) return ssw_put_f32(to, within(c, value));
  const float raw = raw_value(c, range, value);
  if (c.dtype == SSW_U16) return ssw_put_u16(to, static_cast<std::uint16_t>(raw));
  *to = static_cast<std::uint8_t>(raw);
}

}  // namespace

float rounded(const DeviceChannel& c, float value) {
  return c.dtype == SSW_F32 ? within(c, value) : c.offset + c.scale * raw_value(c, raw_range(c), value);
}

bool DeviceChannel::is_compatible_with(const DeviceChannel& o) const {
  return name == o.name && unit == o.unit && sensor == o.sensor && dtype == o.dtype &&
         components == o.components && minimum == o.minimum && maximum == o.maximum && safe == o.safe &&
         scale == o.scale && offset == o.offset && flags == o.flags;
}

bool DeviceDescription::is_compatible_with(const DeviceDescription& o) const {
  return name == o.name && rows == o.rows && columns == o.columns && period_us == o.period_us &&
         pitch == o.pitch && version == o.version && id == o.id && abilities == o.abilities &&
         mask == o.mask && positions == o.positions &&
         std::ranges::equal(channels, o.channels, &DeviceChannel::is_compatible_with);
}

DeviceLink::DeviceLink() { reset(); }

void DeviceLink::reset() {
  const auto damaged = receiver_.damaged;
  ssw_receiver_init(&receiver_);
  receiver_.damaged = damaged;
  described_ = in_frame_ = has_sequence_ = false;
  channels_remaining_ = mask_remaining_ = positions_remaining_ = 0;
}

void DeviceLink::count_sequence(std::uint8_t sequence) {
  const auto gap = static_cast<std::uint8_t>(has_sequence_ ? sequence - expected_ : 0);
  is_repeated_ = gap == 255;
  if (gap != 0 && !is_repeated_) {
    lost_ += gap;
    in_frame_ = false;  // the next chunk may be another frame's
  }
  has_sequence_ = true;
  expected_ = static_cast<std::uint8_t>(sequence + 1);
}

DeviceLink::Event DeviceLink::receive(std::uint8_t byte) {
  ssw_packet packet;
  if (!ssw_receive(&receiver_, byte, &packet)) return Event::kNothing;
  count_sequence(packet.sequence);
  return handle_packet(packet);
}

DeviceLink::Event DeviceLink::handle_packet(const ssw_packet& packet) {
  switch (packet.type) {
    case SSW_HELLO:
      return handle_hello(packet);
    case SSW_HELLO2:
      return handle_hello2(packet);
    case SSW_CHANNEL:
    case SSW_CHANNEL2:
      return handle_channel(packet);
    case SSW_CELLS:
      return handle_cells(packet);
    case SSW_CLOCK:
      return ssw_get_clock(&packet, &clock_) ? Event::kClock : Event::kAlive;
    case SSW_STATUS:
      return ssw_get_status(&packet, &status_) ? Event::kStatus : Event::kAlive;
    case SSW_SENSOR_DATA:
      return handle_data(packet);
    case SSW_SENSOR_END:
      return handle_end(packet);
    case SSW_ERROR:
      if (packet.payload_bytes < 2) return Event::kAlive;
      message_ = common::printable(
          {reinterpret_cast<const char*>(packet.payload) + 2, packet.payload_bytes - std::size_t{2}});
      return Event::kFault;
    default:
      return Event::kAlive;
  }
}

// ---- description
DeviceLink::Event DeviceLink::reject(const std::string& reason) {
  channels_remaining_ = 0;
  message_ = reason;
  return Event::kRejected;
}

DeviceLink::Event DeviceLink::handle_hello(const ssw_packet& packet) {
  ssw_hello hello;
  if (!ssw_get_hello(&packet, &hello)) return Event::kAlive;
  if (hello.version != SSW_VERSION)
    return reject("the device speaks version " + std::to_string(hello.version) +
                  " of the byte protocol, not " + std::to_string(SSW_VERSION));
  return begin_description(hello, 1);
}

DeviceLink::Event DeviceLink::handle_hello2(const ssw_packet& packet) {
  ssw_hello2 board;
  if (!ssw_get_hello2(&packet, &board)) return Event::kAlive;
  if (board.hello.version != SSW_VERSION_2)
    return reject("the device speaks version " + std::to_string(board.hello.version) +
                  " of the byte protocol; 1 and 2 are known");
  const Event event = begin_description(board.hello, 2);
  if (event == Event::kRejected) return event;
  DeviceDescription& d = incoming_description_;
  d.id = text_of(board.id);
  d.abilities = board.abilities;
  d.program_hash = board.program_hash;
  d.sense_delay_us = board.sense_delay_us;
  d.actuate_delay_us = board.actuate_delay_us;
  const std::size_t cells = std::size_t{d.rows} * d.columns;
  if (d.abilities & SSW_HAS_MASK) mask_remaining_ = cells;
  if (d.abilities & SSW_HAS_POSITIONS) positions_remaining_ = cells;
  return event;
}

DeviceLink::Event DeviceLink::begin_description(const ssw_hello& hello, int version) {
  const std::size_t cells = std::size_t{hello.rows} * hello.columns;
  if (hello.channels < 1 || hello.channels > SSW_MAX_CHANNELS)
    return reject("the device has " + std::to_string(hello.channels) + " channels; 1 to 8 are possible");
  if (cells == 0 || cells > kMaxElements) return reject("the device has an impossible number of cells");
  if (hello.period_us == 0) return reject("the device's control period is 0");
  if (!std::isfinite(hello.pitch) || !(hello.pitch > 0)) return reject("the device's pitch is not above 0");
  incoming_description_ = {};
  incoming_description_.name = text_of(hello.name);
  incoming_description_.rows = hello.rows;
  incoming_description_.columns = hello.columns;
  incoming_description_.period_us = hello.period_us;
  incoming_description_.pitch = hello.pitch;
  incoming_description_.boot = hello.boot;
  incoming_description_.version = version;
  channels_remaining_ = hello.channels;
  mask_remaining_ = positions_remaining_ = 0;
  return Event::kAlive;
}

DeviceLink::Event DeviceLink::handle_channel(const ssw_packet& packet) {
  ssw_channel2 channel{};
  const bool second = packet.type == SSW_CHANNEL2;
  if (!(second ? ssw_get_channel2(&packet, &channel) : ssw_get_channel(&packet, &channel.channel)) ||
      channels_remaining_ == 0 || second != (incoming_description_.version == 2))
    return Event::kAlive;
  return add_channel(channel);
}

DeviceLink::Event DeviceLink::add_channel(const ssw_channel2& channel) {
  const ssw_channel& c = channel.channel;
  if (c.index != incoming_description_.channels.size()) {
    channels_remaining_ = 0;  // an earlier channel was lost; the description is requested again
    return Event::kAlive;
  }
  const std::string name = text_of(c.name);
  if (const std::string fault = validate_channel(c); !fault.empty())
    return reject("channel " + std::to_string(c.index) + " '" + name + "' of the device: " + fault);
  const bool sensor = c.direction == SSW_SENSOR;
  if (std::ranges::any_of(incoming_description_.channels, [&](const DeviceChannel& before) {
        return before.name == name && before.sensor == sensor;
      }))
    return reject("channel " + std::to_string(c.index) + " '" + name + "' of the device: is named twice");
  const std::size_t elements =
      std::size_t{incoming_description_.rows} * incoming_description_.columns * c.components;
  std::size_t first = 0;
  for (const DeviceChannel& before : incoming_description_.channels)
    if (before.sensor == sensor) first += before.elements;
  if (first + elements > kMaxElements) return reject("the device's frames are too large");
  incoming_description_.channels.push_back({name, text_of(c.unit), sensor, c.dtype, c.components, c.minimum,
                                            c.maximum, c.safe, c.scale, c.offset, elements, first,
                                            channel.limits, channel.flags});
  --channels_remaining_;
  return end_description_if_complete();
}

// Chunks ascend; after a loss, the description is requested again.
DeviceLink::Event DeviceLink::handle_cells(const ssw_packet& packet) {
  if (packet.payload_bytes <= SSW_CELLS_HEADER || channels_remaining_ != 0) return Event::kAlive;
  const std::size_t first = ssw_get_u16(packet.payload), bytes = packet.payload_bytes - SSW_CELLS_HEADER;
  const std::uint8_t* from = packet.payload + SSW_CELLS_HEADER;
  if (packet.payload[2] == SSW_MASK) {
    std::vector<std::uint8_t>& mask = incoming_description_.mask;
    if (first != mask.size() || bytes > mask_remaining_) return Event::kAlive;
    for (std::size_t i = 0; i < bytes; ++i) mask.push_back(from[i] != 0);
    mask_remaining_ -= bytes;
  } else if (packet.payload[2] == SSW_POSITIONS) {
    auto& positions = incoming_description_.positions;
    const std::size_t count = bytes / 12;
    if (first != positions.size() || bytes % 12 != 0 || count > positions_remaining_) return Event::kAlive;
    for (std::size_t i = 0; i < count; ++i) {
      std::array<float, 3> at;
      for (std::size_t k = 0; k < 3; ++k) at[k] = ssw_get_f32(from + 12 * i + 4 * k);
      if (!std::ranges::all_of(at, [](float x) { return std::isfinite(x); }))
        return reject("the position of cell " + std::to_string(first + i) + " of the device is not finite");
      positions.push_back(at);
    }
    positions_remaining_ -= count;
  } else {
    return Event::kAlive;
  }
  return end_description_if_complete();
}

DeviceLink::Event DeviceLink::end_description_if_complete() {
  if (channels_remaining_ != 0 || mask_remaining_ != 0 || positions_remaining_ != 0) return Event::kAlive;
  if (incoming_description_.channels.empty()) return Event::kAlive;
  description_ = incoming_description_;
  described_ = true;
  sensor_elements_ = actuator_elements_ = 0;
  for (const DeviceChannel& d : description_.channels)
    (d.sensor ? sensor_elements_ : actuator_elements_) += d.elements;
  frame_.values.resize(sensor_elements_);  // what came before the description is still to be read
  partial_frame_.values.assign(sensor_elements_, 0.0F);
  in_frame_ = false;
  return Event::kDescribed;
}

// ---- sensor frames
// The chunks of a frame ascend; otherwise it is discarded.
DeviceLink::Event DeviceLink::handle_data(const ssw_packet& packet) {
  if (!described_ || is_repeated_ || packet.payload_bytes <= SSW_DATA_HEADER) return Event::kAlive;
  const std::size_t index = packet.payload[0];
  if (index >= description_.channels.size() || !description_.channels[index].sensor) return Event::kAlive;
  const DeviceChannel& c = description_.channels[index];
  const std::size_t size = ssw_dtype_bytes(c.dtype), bytes = packet.payload_bytes - SSW_DATA_HEADER;
  const std::size_t first = ssw_get_u32(packet.payload + 2), count = bytes / size;
  if (bytes % size != 0 || first > c.elements || count > c.elements - first) return Event::kAlive;
  if (c.first_element + first == 0) {
    in_frame_ = true;
    partial_frame_.tick = packet.tick;
    partial_elements_ = 0;
  }
  if (!in_frame_ || partial_frame_.tick != packet.tick || c.first_element + first != partial_elements_) {
    in_frame_ = false;
    return Event::kAlive;
  }
  for (std::size_t i = 0; i < count; ++i)
    partial_frame_.values[partial_elements_++] = value_at(c, packet.payload + SSW_DATA_HEADER + i * size);
  return Event::kAlive;
}

DeviceLink::Event DeviceLink::handle_end(const ssw_packet& packet) {
  if (!described_ || packet.payload_bytes != SSW_SENSOR_END_BYTES) return Event::kAlive;
  const bool whole = in_frame_ && partial_frame_.tick == packet.tick &&
                     partial_elements_ == sensor_elements_ && ssw_get_u32(packet.payload) == sensor_elements_;
  in_frame_ = false;
  if (!whole && sensor_elements_ != 0) return Event::kAlive;
  partial_frame_.tick = packet.tick;
  partial_frame_.flags = ssw_get_u32(packet.payload + 4);
  partial_frame_.missed = ssw_get_u32(packet.payload + 8);
  partial_frame_.active_tick = ssw_get_u32(packet.payload + 12);
  std::swap(frame_, partial_frame_);
  return Event::kFrame;
}

// ---- to the device
void DeviceLink::append(const ssw_packet& packet, std::vector<std::uint8_t>& to) {
  std::array<std::uint8_t, SSW_MAX_ENCODED + 2> framed;
  const std::size_t bytes = ssw_write(&packet, framed.data());
  assert(bytes != 0);
  to.insert(to.end(), framed.begin(), framed.begin() + bytes);
}

void DeviceLink::write(std::uint8_t type, std::uint32_t tick, std::vector<std::uint8_t>& to) {
  append({type, sequence_++, tick, nullptr, 0}, to);
}

void DeviceLink::write_sync(const ssw_sync& sync, std::uint32_t tick, std::vector<std::uint8_t>& to) {
  std::array<std::uint8_t, SSW_SYNC_BYTES> payload;
  ssw_put_sync(&sync, payload.data());
  append({SSW_SYNC, sequence_++, tick, payload.data(), payload.size()}, to);
}

void DeviceLink::write_reason(std::uint8_t type, std::uint32_t reason, std::vector<std::uint8_t>& to) {
  std::array<std::uint8_t, SSW_STOP_NOW_BYTES> payload;
  ssw_put_u32(payload.data(), reason);
  append({type, sequence_++, 0, payload.data(), payload.size()}, to);
}

void DeviceLink::write_frame(std::uint32_t tick, std::span<const float> values,
                             std::vector<std::uint8_t>& to) {
  assert(described_ && values.size() == actuator_elements_);
  std::array<std::uint8_t, SSW_MAX_PAYLOAD> payload;
  for (std::size_t index = 0; index < description_.channels.size(); ++index) {
    const DeviceChannel& c = description_.channels[index];
    if (c.sensor) continue;
    const std::size_t size = ssw_dtype_bytes(c.dtype);
    const ssw_raw_range range = raw_range(c);
    for (std::size_t first = 0; first < c.elements;) {
      const std::size_t count = std::min<std::size_t>(c.elements - first, SSW_MAX_DATA / size);
      payload[0] = static_cast<std::uint8_t>(index);
      payload[1] = 0;
      ssw_put_u32(&payload[2], static_cast<std::uint32_t>(first));
      for (std::size_t i = 0; i < count; ++i)
        put_value(c, range, values[c.first_element + first + i], &payload[SSW_DATA_HEADER + i * size]);
      append({SSW_ACTUATOR_DATA, sequence_++, tick, payload.data(), SSW_DATA_HEADER + count * size}, to);
      first += count;
    }
  }
  ssw_put_u32(payload.data(), static_cast<std::uint32_t>(actuator_elements_));
  append({SSW_ACTUATOR_END, sequence_++, tick, payload.data(), SSW_ACTUATOR_END_BYTES}, to);
}

}  // namespace hardware
