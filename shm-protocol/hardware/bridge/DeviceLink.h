// The host's end of the byte protocol, without I/O: decodes descriptions and sensor frames, encodes commands
// and actuator frames.
//
// One thread at a time. Once the device is described, receive(), write() and write_frame() do not allocate,
// except in the caller's buffer.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "shm-protocol/hardware/firmware/wire.h"

namespace hardware {

// A frame that is ahead of the last one by more comes from a device whose ticks have restarted.
constexpr std::uint32_t kMaxLostTicks = 1u << 30;

struct DeviceChannel {
  std::string name, unit;
  bool sensor = true;
  std::uint8_t dtype = SSW_U8;  // ssw_dtype of its elements on the wire
  std::uint32_t components = 1;
  float minimum = 0, maximum = 1, safe = 0;
  float scale = 1, offset = 0;    // value = offset + scale × raw
  std::size_t elements = 0;       // components × rows × columns
  std::size_t first_element = 0;  // index of its first element in a frame of its direction
  ssw_limits limits{};            // that the device keeps; 0: none
  std::uint16_t flags = 0;        // SSW_VECTOR, SSW_AXIAL_VECTOR

  // Returns whether all fields except the limits are equal.
  bool is_compatible_with(const DeviceChannel&) const;
  // Returns whether raw values equal channel values, so that they need no conversion to f32.
  bool is_plain_u8() const {
    return dtype == SSW_U8 && scale == 1 && offset == 0 && minimum >= 0 && maximum <= 255;
  }
};

// A value of an actuator as the device gets it: within the range, of its resolution.
float rounded(const DeviceChannel&, float value);

struct DeviceDescription {
  std::string name;
  std::uint32_t rows = 0, columns = 0;
  std::uint32_t period_us = 0;
  float pitch = 1;
  std::uint32_t boot = 0;  // changes at every start of the device
  std::vector<DeviceChannel> channels;
  // Version 2 of the byte protocol.
  int version = 1;
  std::string id;
  std::uint32_t abilities = 0, program_hash = 0;
  std::uint32_t sense_delay_us = 0, actuate_delay_us = 0;
  std::vector<std::uint8_t> mask;               // by cell, 1: it exists; empty: all exist
  std::vector<std::array<float, 3>> positions;  // by cell, from the board's north-west cell; empty: a grid

  bool can_sync() const { return (abilities & SSW_CAN_SYNC) != 0; }
  // Returns whether all fields except `boot`, `program_hash`, delays and limits are equal.
  bool is_compatible_with(const DeviceDescription&) const;
};

struct SensorFrame {
  std::uint32_t tick = 0;
  std::uint32_t flags = 0;               // SSW_MISSED, SSW_SAFE
  std::uint32_t missed = 0;              // deadlines missed since the device started
  std::uint32_t active_tick = SSW_NONE;  // tick that the active actuator frame answers
  // All sensor channels, concatenated in the device's order; scaled values, not raw.
  std::vector<float> values;
};

class DeviceLink {
 public:
  enum class Event {
    kNothing,
    kAlive,      // a valid packet without further effect
    kDescribed,  // description() was updated
    kRejected,   // the device's description is invalid or of another version: see message()
    kFrame,      // frame() was updated
    kClock,      // clock() was updated
    kStatus,     // status() was updated
    kFault       // the device reports a fault: see message()
  };

  DeviceLink();

  // Processes one byte from the device.
  Event receive(std::uint8_t byte);

  bool described() const { return described_; }
  const DeviceDescription& description() const { return description_; }
  const SensorFrame& frame() const { return frame_; }
  const std::string& message() const { return message_; }
  const ssw_clock& clock() const { return clock_; }
  const ssw_status& status() const { return status_; }
  // Discards the description and all partial input after the line was lost.
  void reset();

  // Appends a packet without payload: SSW_DESCRIBE, SSW_DESCRIBE2, SSW_START, SSW_STOP, SSW_HEARTBEAT.
  void write(std::uint8_t type, std::uint32_t tick, std::vector<std::uint8_t>& to);
  void write_sync(const ssw_sync&, std::uint32_t tick, std::vector<std::uint8_t>& to);
  // Appends SSW_STOP_NOW or SSW_ARM.
  void write_reason(std::uint8_t type, std::uint32_t reason, std::vector<std::uint8_t>& to);
  // Appends an actuator frame that answers the sensor frame of that tick. `values`: all actuator channels,
  // concatenated in the device's order; each value is clamped to its channel's range and rounded to the
  // nearest raw value within it.
  void write_frame(std::uint32_t tick, std::span<const float> values, std::vector<std::uint8_t>& to);

  std::size_t actuator_elements() const { return actuator_elements_; }

  std::uint64_t damaged_packets() const { return receiver_.damaged; }
  std::uint64_t lost_packets() const { return lost_; }  // from sequence gaps, up to 254 each

 private:
  Event handle_packet(const ssw_packet&);
  Event handle_hello(const ssw_packet&);
  Event handle_hello2(const ssw_packet&);
  Event begin_description(const ssw_hello&, int version);
  Event handle_channel(const ssw_packet&);
  Event add_channel(const ssw_channel2&);
  Event handle_cells(const ssw_packet&);
  Event end_description_if_complete();
  Event handle_data(const ssw_packet&);
  Event handle_end(const ssw_packet&);
  Event reject(const std::string& reason);
  void count_sequence(std::uint8_t sequence);
  void append(const ssw_packet&, std::vector<std::uint8_t>& to);

  ssw_receiver receiver_{};
  DeviceDescription description_, incoming_description_;
  std::size_t channels_remaining_ = 0, mask_remaining_ = 0, positions_remaining_ = 0;
  bool described_ = false;
  std::size_t sensor_elements_ = 0, actuator_elements_ = 0;

  SensorFrame frame_, partial_frame_;
  std::size_t partial_elements_ = 0;
  bool in_frame_ = false;

  std::string message_;
  ssw_clock clock_{};
  ssw_status status_{};
  std::uint8_t sequence_ = 0, expected_ = 0;
  bool has_sequence_ = false, is_repeated_ = false;  // of the last packet
  std::uint64_t lost_ = 0;
};

}  // namespace hardware
