// A device of one cell, of version 1, that the test steps: it says what it is told to.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/firmware/wire.h"
#include "tests/system/hardware/Listener.h"

namespace hardware {

class SteppedDevice {
 public:
  static constexpr std::uint32_t kPeriod_us = 10'000;

  using Sensors = std::vector<std::pair<std::string, std::string>>;  // names and units

  // All channels are of bytes.
  explicit SteppedDevice(const Sensors& sensors, const std::vector<std::string>& actuators = {})
      : sensors_(sensors.size()) {
    ssw_hello hello{SSW_VERSION, 0, 1, 1, kPeriod_us, 1, 1, "d"};
    hello.channels = static_cast<std::uint8_t>(sensors.size() + actuators.size());
    std::uint8_t payload[SSW_CHANNEL_BYTES];
    ssw_put_hello(&hello, payload);
    add(SSW_HELLO, {payload, SSW_HELLO_BYTES});
    for (std::uint8_t i = 0; i < hello.channels; ++i) {
      const bool sensor = i < sensors.size();
      ssw_channel c{i, sensor ? SSW_SENSOR : SSW_ACTUATOR, SSW_U8, 1, 0, 255, 0, 1, 0, {}, {}};
      (sensor ? sensors[i].first : actuators[i - sensors.size()]).copy(c.name, sizeof c.name);
      if (sensor) sensors[i].second.copy(c.unit, sizeof c.unit);
      ssw_put_channel(&c, payload);
      add(SSW_CHANNEL, {payload, SSW_CHANNEL_BYTES});
    }
  }
  ~SteppedDevice() { cut(); }
  SteppedDevice(const SteppedDevice&) = delete;
  SteppedDevice& operator=(const SteppedDevice&) = delete;

  const std::string& port() const { return listener_.port; }

  // Accepts the bridge and describes itself.
  void connect() {
    line_ = listener_.accept();
    send();
  }
  void cut() {
    if (line_ >= 0) ::close(line_);
    line_ = -1;
  }
  // Sends the frame of that tick, whose sensors read the tick. Safe values are said to be in force.
  void send_frame(std::uint32_t tick) {
    for (std::uint8_t channel = 0; channel < sensors_; ++channel) {
      const std::uint8_t data[SSW_DATA_HEADER + 1] = {
          channel, 0, 0, 0, 0, 0, static_cast<std::uint8_t>(tick)};
      add(SSW_SENSOR_DATA, data, tick);
    }
    const std::uint8_t end[SSW_SENSOR_END_BYTES] = {static_cast<std::uint8_t>(sensors_), 0, 0, 0, SSW_SAFE};
    add(SSW_SENSOR_END, end, tick);
    send();
  }
  // Waits for a packet of that type, of any tick but 0, or this one. Returns its tick.
  std::uint32_t await(std::uint8_t type) {
    return await_packet([type](const ssw_packet& p) { return p.type == type && p.tick != 0; });
  }
  void await(std::uint8_t type, std::uint32_t tick) {
    (void)await_packet([=](const ssw_packet& p) { return p.type == type && p.tick == tick; });
  }
  void await_leave() {
    for (char byte; ::read(line_, &byte, 1) > 0;) {
    }
  }

 private:
  void add(std::uint8_t type, std::span<const std::uint8_t> payload, std::uint32_t tick = 0) {
    std::uint8_t encoded[SSW_MAX_ENCODED + 2];
    const ssw_packet packet{type, sequence_++, tick, payload.data(), payload.size()};
    out_.append(reinterpret_cast<const char*>(encoded), ssw_write(&packet, encoded));
  }
  void send() {
    EXPECT_EQ(::send(line_, out_.data(), out_.size(), MSG_NOSIGNAL), std::ssize(out_));
    out_.clear();
  }
  template <class Condition>
  std::uint32_t await_packet(Condition is_awaited) {
    ssw_packet packet;
    for (std::uint8_t byte; ::read(line_, &byte, 1) > 0;)
      if (ssw_receive(&receiver_, byte, &packet) && is_awaited(packet)) return packet.tick;
    ADD_FAILURE() << "the bridge left";
    return 0;
  }

  Listener listener_;
  int line_ = -1;
  std::size_t sensors_;
  ssw_receiver receiver_{};
  std::uint8_t sequence_ = 0;
  std::string out_;
};

}  // namespace hardware
