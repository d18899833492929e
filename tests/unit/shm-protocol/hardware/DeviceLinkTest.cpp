// DeviceLink against the reference firmware, byte by byte, over good and bad lines.
#include "shm-protocol/hardware/bridge/DeviceLink.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <utility>

#include "shm-protocol/hardware/fake/NoisyLine.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"
#include "shm-protocol/hardware/fake/toy.h"

namespace hardware {
namespace {

using Event = DeviceLink::Event;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint16_t kRows = 20, kColumns = 30;
constexpr std::size_t kCells = std::size_t{kRows} * kColumns;

// Raw heights that encode their tick.
std::uint8_t commanded(std::uint64_t tick, std::size_t cell) {
  return static_cast<std::uint8_t>((tick * 5 + cell * 3) % 200 + 1);
}
std::vector<float> command(std::uint64_t tick) {
  std::vector<float> values(kCells);
  for (std::size_t i = 0; i < kCells; ++i) values[i] = static_cast<float>(commanded(tick, i)) * 0.02F;
  // With the range 0 … 4 and steps of 0.02, 200 is the highest raw value.
  return values;
}

struct Pair {
  explicit Pair(std::uint16_t rows = kRows, std::uint16_t columns = kColumns)
      : device(rows, columns, 10'000, [this](const std::uint8_t* b, std::size_t n) {
          up.insert(up.end(), b, b + n);
          return true;
        }) {}

  // Carries what lies on the line; the events of the host, without those that mean nothing.
  std::vector<Event> carry() {
    std::vector<Event> events;
    for (const std::uint8_t b : std::exchange(down, {})) device.receive(b);
    for (const std::uint8_t b : std::exchange(up, {}))
      if (const Event e = link.receive(b); e != Event::kNothing && e != Event::kAlive) events.push_back(e);
    return events;
  }
  void start(ssw_type describe = SSW_DESCRIBE) {
    link.write(describe, 0, down);
    link.write(SSW_START, 0, down);
    ASSERT_EQ(carry(), std::vector<Event>{Event::kDescribed});
  }

  Bytes up, down;
  ToyDevice device;
  DeviceLink link;
};

// The frame is the one of its tick.
bool is_right(const SensorFrame& frame) {
  for (std::uint32_t row = 0, cell = 0; row < kRows; ++row)
    for (std::uint32_t column = 0; column < kColumns; ++column, ++cell)
      if (frame.values[cell] != static_cast<float>(toy_hit(kRows, kColumns, frame.tick, row, column)))
        return false;
  return true;
}

TEST(DeviceLink, ReceivesDeviceDescription) {
  Pair pair;
  pair.start();
  const DeviceDescription& d = pair.link.description();
  EXPECT_EQ(d.name, "toy");
  EXPECT_EQ(d.rows, kRows);
  EXPECT_EQ(d.columns, kColumns);
  EXPECT_EQ(d.period_us, 10'000u);
  ASSERT_EQ(d.channels.size(), 4u);
  EXPECT_EQ(d.channels[1].name, "pin_height");
  EXPECT_EQ(d.channels[1].unit, "u");
  EXPECT_EQ(d.channels[1].dtype, SSW_U16);
  EXPECT_FLOAT_EQ(d.channels[1].scale, 0.001F);
  EXPECT_TRUE(d.channels[2].sensor);
  EXPECT_FALSE(d.channels[3].sensor);
  EXPECT_EQ(pair.link.actuator_elements(), kCells);
}

TEST(DeviceLink, FramesGoBothWaysInStep) {
  Pair pair;
  pair.start();
  for (std::uint32_t tick = 1; tick <= 50; ++tick) {
    pair.device.period();
    ASSERT_EQ(pair.carry(), std::vector<Event>{Event::kFrame});
    const SensorFrame& frame = pair.link.frame();
    EXPECT_EQ(frame.tick, tick);
    EXPECT_TRUE(is_right(frame));
    EXPECT_EQ(frame.missed, 0u);
    EXPECT_EQ(frame.active_tick, tick == 1 ? SSW_NONE : tick - 1);
    EXPECT_EQ(frame.flags, tick == 1 ? SSW_SAFE : 0u);
    pair.link.write_frame(tick, command(tick), pair.down);
    pair.carry();
  }
  pair.device.period();
  for (std::size_t i = 0; i < kCells; ++i) ASSERT_EQ(pair.device.heights()[i], commanded(50, i));
}

TEST(DeviceLink, FrameIsKeptWhenTheDeviceDescribesItselfAgain) {
  Pair pair;
  pair.start();
  pair.device.period();
  pair.link.write(SSW_DESCRIBE, 1, pair.down);
  ASSERT_EQ(pair.carry(), (std::vector<Event>{Event::kFrame, Event::kDescribed}));
  EXPECT_EQ(pair.link.frame().tick, 1u);
  EXPECT_TRUE(is_right(pair.link.frame()));
}

TEST(DeviceLink, ClampsValuesToTheRange) {
  Pair pair;
  pair.start();
  pair.device.period();
  pair.carry();
  std::vector<float> values(kCells, 1.0F);
  values[0] = std::numeric_limits<float>::quiet_NaN();
  values[1] = std::numeric_limits<float>::infinity();
  values[2] = -7.0F;
  values[3] = 0.0299F;
  values[4] = 0.0301F;
  pair.link.write_frame(1, values, pair.down);
  pair.carry();
  pair.device.period();
  const auto& heights = pair.device.heights();
  EXPECT_EQ(heights[0], 0);
  EXPECT_EQ(heights[1], 200);
  EXPECT_EQ(heights[2], 0);
  EXPECT_EQ(heights[3], 1);
  EXPECT_EQ(heights[4], 2);
  EXPECT_EQ(heights[5], 50);
}

// Splits a stream into packets, which are separated by two zeros.
std::vector<Bytes> packets_of(const Bytes& stream) {
  std::vector<Bytes> packets;
  for (const std::uint8_t b : stream) {
    if (packets.empty() || (packets.back().size() > 1 && packets.back().back() == 0)) packets.emplace_back();
    packets.back().push_back(b);
  }
  return packets;
}

Bytes joined(const std::vector<Bytes>& packets) {
  Bytes stream;
  for (const Bytes& p : packets) stream.insert(stream.end(), p.begin(), p.end());
  return stream;
}

Bytes framed(const ssw_packet& packet) {
  Bytes bytes(SSW_MAX_ENCODED + 2);
  bytes.resize(ssw_write(&packet, bytes.data()));
  return bytes;
}

// That packet, in the next place of the sequence.
Bytes succeeding(const Bytes& bytes) {
  ssw_receiver receiver;
  ssw_receiver_init(&receiver);
  ssw_packet packet{};
  for (const std::uint8_t b : bytes) ssw_receive(&receiver, b, &packet);
  ++packet.sequence;
  return framed(packet);
}

// The right number of elements is not a frame if one chunk came twice and another not at all.
TEST(DeviceLink, RejectsMisplacedChunks) {
  Pair pair;
  pair.start();
  pair.device.period();
  auto packets = packets_of(pair.up);
  ASSERT_EQ(packets[4].size(), packets[5].size());  // of pin_height
  packets[5] = succeeding(packets[4]);
  pair.up = joined(packets);
  EXPECT_TRUE(pair.carry().empty());

  Pair larger(40, 30);
  larger.start();
  larger.device.period();
  larger.carry();
  larger.link.write_frame(1, std::vector<float>(1200, 2.0F), larger.down);
  packets = packets_of(larger.down);
  ASSERT_EQ(packets[2].size(), packets[3].size());
  packets[3] = succeeding(packets[2]);
  larger.down = joined(packets);
  larger.carry();
  larger.device.period();
  EXPECT_EQ(larger.device.heights()[0], 0);
}

// A burst of losses, a packet that comes twice, or two in the wrong order. Returns whether all came in order.
bool disturb(std::vector<Bytes>& packets, std::mt19937& random) {
  const std::size_t first = random() % packets.size(), count = 1 + random() % (packets.size() - first);
  const auto at = packets.begin() + static_cast<std::ptrdiff_t>(first);
  const unsigned kind = random() % 8;
  if (kind == 0)
    packets.insert(at, Bytes(*at));
  else if (kind == 1)
    std::iter_swap(at, at + static_cast<std::ptrdiff_t>(count) - 1);
  else
    packets.erase(at, at + static_cast<std::ptrdiff_t>(count));
  return kind == 0 || (kind == 1 && count == 1);
}

// In passive mode a tick has several answers. One of them takes effect as a whole, or none.
TEST(DeviceLink, ActuatorFramesOfATickAreNotMixed) {
  for (const ssw_type description : {SSW_DESCRIBE, SSW_DESCRIBE2}) {
    std::mt19937 random(31);
    Pair pair(40, 30);
    pair.start(description);
    int answered = 0;
    for (int i = 0; i < 300; ++i) {
      pair.device.period();
      const std::uint32_t tick = pair.device.firmware().tick;
      for (const float height : {1.0F, 2.0F, 3.0F})
        pair.link.write_frame(tick, std::vector<float>(1200, height), pair.down);
      auto packets = packets_of(std::exchange(pair.down, {}));
      const bool all_came = disturb(packets, random);
      for (const std::uint8_t b : joined(packets)) pair.device.receive(b);
      pair.device.period();
      const auto heights = pair.device.heights();
      ASSERT_EQ(std::ranges::count(heights, heights[0]), 1200) << i;
      if (all_came) {
        ASSERT_EQ(heights[0], 150) << i;
      }
      answered += pair.device.firmware().in_force == tick;
      pair.up.clear();
    }
    EXPECT_GT(answered, 100);
  }
}

// A sensor frame of the toy, of that raw value everywhere.
void append_frame(std::uint8_t raw, std::uint32_t tick, std::uint8_t& sequence, std::vector<Bytes>& to) {
  constexpr std::size_t kChunk = 100, kChunkBytes[] = {kChunk, 2 * kChunk, kChunk};
  for (std::uint8_t channel = 0; channel < 3; ++channel)
    for (std::uint32_t first = 0; first < kCells; first += kChunk) {
      Bytes data(SSW_DATA_HEADER + kChunkBytes[channel]);
      data[0] = channel;
      ssw_put_u32(&data[2], first);
      for (std::size_t i = SSW_DATA_HEADER; i < data.size(); i += channel == 1 ? 2 : 1) data[i] = raw;
      to.push_back(framed({SSW_SENSOR_DATA, sequence++, tick, data.data(), data.size()}));
    }
  Bytes end(SSW_SENSOR_END_BYTES);
  ssw_put_u32(end.data(), 3 * kCells);
  to.push_back(framed({SSW_SENSOR_END, sequence++, tick, end.data(), end.size()}));
}

// Ticks begin again with a restart of the device.
TEST(DeviceLink, SensorFramesOfATickAreNotMixed) {
  for (const ssw_type description : {SSW_DESCRIBE, SSW_DESCRIBE2}) {
    std::mt19937 random(32);
    Pair pair;
    pair.start(description);
    std::uint8_t sequence = pair.device.firmware().sequence;
    int frames = 0;
    for (std::uint32_t i = 0; i < 300; ++i) {
      std::vector<Bytes> packets;
      for (const std::uint8_t raw : {1, 2, 3}) append_frame(raw, i, sequence, packets);
      const bool all_came = disturb(packets, random);
      int complete = 0;
      for (const std::uint8_t b : joined(packets)) {
        if (pair.link.receive(b) != Event::kFrame) continue;
        const auto& values = pair.link.frame().values;
        for (std::size_t k = 0; k < kCells; ++k) {
          ASSERT_EQ(values[k], values[0]) << i;
          ASSERT_EQ(values[kCells + k], values[0] * 0.001F) << i;
          ASSERT_EQ(values[2 * kCells + k], values[0]) << i;
        }
        ++complete;
      }
      if (all_came) {
        ASSERT_EQ(complete, 3) << i;
      }
      frames += complete;
    }
    EXPECT_GT(frames, 300);
  }
}

TEST(DeviceLink, AbandonsFrameWithMissingPacket) {
  Pair whole;
  whole.start();
  whole.device.period();
  const std::vector<Bytes> packets = packets_of(whole.up);
  ASSERT_GT(packets.size(), 8u);
  for (std::size_t missing = 0; missing < packets.size(); ++missing) {
    Pair pair;
    pair.start();
    pair.device.period();
    pair.up.clear();
    for (std::size_t i = 0; i < packets.size(); ++i)
      if (i != missing) pair.up.insert(pair.up.end(), packets[i].begin(), packets[i].end());
    EXPECT_TRUE(pair.carry().empty()) << "without packet " << missing;
    EXPECT_EQ(pair.link.lost_packets(), missing + 1 < packets.size() ? 1u : 0u);
    pair.device.period();
    ASSERT_EQ(pair.carry(), std::vector<Event>{Event::kFrame}) << "after packet " << missing;
    EXPECT_EQ(pair.link.frame().tick, 2u);
    EXPECT_TRUE(is_right(pair.link.frame()));
  }
}

TEST(DeviceLink, DuplicatedPacketIsNoLoss) {
  Pair pair;
  pair.start();
  pair.device.period();
  for (const Bytes& packet : packets_of(std::exchange(pair.up, {})))
    for (int copy = 0; copy < 2; ++copy) pair.up.insert(pair.up.end(), packet.begin(), packet.end());
  EXPECT_EQ(pair.carry(), std::vector<Event>{Event::kFrame});
  EXPECT_TRUE(is_right(pair.link.frame()));
  EXPECT_EQ(pair.link.lost_packets(), 0u);
  pair.device.period();
  EXPECT_EQ(pair.carry(), std::vector<Event>{Event::kFrame});
  EXPECT_EQ(pair.link.lost_packets(), 0u);
}

// A long run over bad lines in both directions. Nothing wrong may come through, on either side, and much
// must.
TEST(DeviceLink, FramesReceivedOverNoiseAreCorrect) {
  Pair pair;
  pair.start();
  NoiseOptions noise{2e-4, 2e-4, {}, 11};
  NoisyLine to_device(noise);
  noise.seed = 12;
  NoisyLine to_host(noise);
  int frames = 0, commands = 0;
  std::uint32_t missed = 0;
  for (std::uint32_t tick = 1; tick <= 3000; ++tick) {
    pair.device.period();
    to_host.send(pair.up.data(), pair.up.size(), {});
    pair.up.clear();
    to_host.receive({}, pair.up);
    for (const Event e : pair.carry()) {
      ASSERT_EQ(e, Event::kFrame);
      const SensorFrame& frame = pair.link.frame();
      ASSERT_EQ(frame.tick, tick);
      ASSERT_TRUE(is_right(frame));
      ++frames;
      missed = frame.missed;
      Bytes answer;
      pair.link.write_frame(frame.tick, command(tick), answer);
      to_device.send(answer.data(), answer.size(), {});
      to_device.receive({}, pair.down);
    }
    for (const std::uint8_t b : std::exchange(pair.down, {})) pair.device.receive(b);
    const std::uint32_t in_force = pair.device.firmware().in_force;
    for (std::size_t i = 0; i < kCells; ++i)
      ASSERT_EQ(pair.device.heights()[i], in_force == SSW_NONE ? 0 : commanded(in_force, i));
    commands += in_force == tick - 1;
  }
  EXPECT_GT(frames, 300);
  EXPECT_LT(frames, 3000);
  EXPECT_GT(commands, 100);
  EXPECT_GT(missed, 100u);
  EXPECT_GT(pair.link.damaged_packets(), 100u);
}

// "µm" in Latin-1 and in UTF-8, an escape sequence, a character that the end of the field cuts.
TEST(DeviceLink, TextsOfADeviceArePrintable) {
  DeviceLink link;
  std::uint8_t sequence = 0;
  Event last = Event::kNothing;
  const auto send = [&](std::uint8_t type, const Bytes& payload) {
    std::uint8_t encoded[SSW_MAX_ENCODED + 2];
    const ssw_packet packet{type, sequence++, 0, payload.data(), payload.size()};
    const std::size_t count = ssw_write(&packet, encoded);
    for (std::size_t i = 0; i < count; ++i)
      if (const Event e = link.receive(encoded[i]); e != Event::kNothing) last = e;
  };
  const auto text = [](Bytes& to, std::size_t at, const std::string& what) {
    std::ranges::copy(what, to.begin() + static_cast<std::ptrdiff_t>(at));
  };
  Bytes hello(34), error{2, 0, 'h', 'e', 0xE9, '\n'};
  hello[0] = 1, hello[1] = 3, hello[2] = hello[4] = 2, hello[7] = 1;
  ssw_put_f32(&hello[10], 1);
  text(hello, 18, "\x1b[2J\xff dev");
  send(SSW_HELLO, hello);
  int index = 0;
  for (const std::string unit : {"\xb5m", "\xc2\xb5m", "fifteen bytes..\xc2"}) {
    Bytes channel(72);
    channel[0] = static_cast<std::uint8_t>(index);
    channel[1] = SSW_SENSOR, channel[2] = SSW_F32, channel[3] = 1;
    ssw_put_f32(&channel[8], 1);
    ssw_put_f32(&channel[16], 1);
    text(channel, 24, "c" + std::to_string(index++));
    text(channel, 56, unit);
    send(SSW_CHANNEL, channel);
  }
  ASSERT_EQ(last, Event::kDescribed) << link.message();
  EXPECT_EQ(link.description().name, "?[2J? dev");
  EXPECT_EQ(link.description().channels[0].unit, "?m");
  EXPECT_EQ(link.description().channels[1].unit, "\xc2\xb5m");
  EXPECT_EQ(link.description().channels[2].unit, "fifteen bytes..?");
  send(SSW_ERROR, error);
  EXPECT_EQ(link.message(), "he??");
}

// Random bytes, and well-formed packets with invalid content: no crash (under sanitizers) and no frame.
TEST(DeviceLink, IgnoresInvalidPackets) {
  std::mt19937 random(21);
  Pair pair;
  pair.start();
  pair.device.period();
  ASSERT_EQ(pair.carry(), std::vector<Event>{Event::kFrame});
  const auto before = pair.link.frame().values;
  for (int i = 0; i < 200'000; ++i) {
    std::uint8_t payload[SSW_MAX_PAYLOAD], bytes[SSW_MAX_ENCODED + 2];
    const std::size_t length = random() % 3 == 0 ? 6 + random() % 12 : random() % (SSW_MAX_PAYLOAD + 1);
    for (std::size_t b = 0; b < length; ++b)
      payload[b] = static_cast<std::uint8_t>(random() % 4 == 0 ? random() : 0);
    const std::uint8_t types[] = {SSW_CHANNEL,       SSW_SENSOR_DATA,  SSW_SENSOR_END,
                                  SSW_ACTUATOR_DATA, SSW_ACTUATOR_END, 0x77};
    const ssw_packet packet{types[random() % 6], static_cast<std::uint8_t>(i),
                            static_cast<std::uint32_t>(random() % 4), payload, length};
    const std::size_t count = ssw_write(&packet, bytes);
    for (std::size_t b = 0; b < count; ++b) {
      ASSERT_NE(pair.link.receive(bytes[b]), Event::kFrame);
      pair.device.receive(bytes[b]);
    }
  }
  EXPECT_EQ(pair.link.frame().values, before);
  pair.up.clear();
  pair.device.period();
  EXPECT_EQ(pair.carry(), std::vector<Event>{Event::kFrame});
}

// The link's reaction to a description with one channel.
Event describe(DeviceLink& link, ssw_hello hello, ssw_channel channel) {
  std::uint8_t payload[SSW_CHANNEL_BYTES], bytes[SSW_MAX_ENCODED + 2];
  Event last = Event::kNothing;
  const auto send = [&](std::uint8_t type, std::size_t length) {
    const ssw_packet packet{type, 0, 0, payload, length};
    const std::size_t count = ssw_write(&packet, bytes);
    for (std::size_t b = 0; b < count; ++b)
      if (const Event e = link.receive(bytes[b]); e != Event::kNothing) last = e;
  };
  ssw_put_hello(&hello, payload);
  send(SSW_HELLO, SSW_HELLO_BYTES);
  if (last == Event::kRejected) return last;
  ssw_put_channel(&channel, payload);
  send(SSW_CHANNEL, SSW_CHANNEL_BYTES);
  return last;
}

TEST(DeviceLink, RejectsInvalidDescriptions) {
  const ssw_hello hello{SSW_VERSION, 1, 4, 4, 1000, 1, 0, "x"};
  const ssw_channel channel{0, SSW_ACTUATOR, SSW_U8, 1, 0, 4, 0, 0.02F, 0, "height", "u"};
  const auto outcome = [&](auto change) {
    ssw_hello h = hello;
    ssw_channel c = channel;
    change(h, c);
    DeviceLink link;
    const Event e = describe(link, h, c);
    EXPECT_EQ(link.message().empty(), e != Event::kRejected);
    return e;
  };
  EXPECT_EQ(outcome([](auto&, auto&) {}), Event::kDescribed);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.version = 2; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.channels = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.channels = 9; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.rows = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.rows = h.columns = 65535; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.period_us = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto& h, auto&) { h.pitch = NAN; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.direction = 3; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.dtype = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.components = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.minimum = 4; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.maximum = INFINITY; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.safe = 5; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.scale = 0; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.dtype = SSW_F32; }), Event::kRejected);
  EXPECT_EQ(outcome([](auto&, auto& c) { c.index = 1; }), Event::kAlive);  // waits for the first one
}

TEST(DeviceLink, RejectionNamesTheField) {
  const auto message = [](float scale, float offset) {
    DeviceLink link;
    EXPECT_EQ(describe(link, {SSW_VERSION, 1, 4, 4, 1000, 1, 0, "x"},
                       {0, SSW_ACTUATOR, SSW_U8, 1, 0, 4, 0, scale, offset, "height", "u"}),
              Event::kRejected);
    return link.message();
  };
  const std::string place = "channel 0 'height' of the device: ";
  EXPECT_EQ(message(0.02F, INFINITY), place + "the offset inf must be finite");
  EXPECT_EQ(message(INFINITY, 0), place + "the scale inf must be finite and above 0");
  EXPECT_EQ(message(-1, 0), place + "the scale -1.000000 must be finite and above 0");
}

// A channel of an actuator with raw numbers.
ssw_channel actuator(ssw_dtype dtype, float minimum, float maximum, float safe, float scale, float offset) {
  return {0,        SSW_ACTUATOR, static_cast<std::uint8_t>(dtype), 1, minimum, maximum, safe, scale, offset,
          "height", "u"};
}
constexpr ssw_hello kOneCell{SSW_VERSION, 1, 1, 1, 1000, 1, 0, "x"};

TEST(DeviceLink, RangeThatRawNumbersCannotExpressIsRejected) {
  const auto message = [](const ssw_channel& channel) {
    DeviceLink link;
    return describe(link, kOneCell, channel) == Event::kDescribed ? std::string() : link.message();
  };
  const std::string place = "channel 0 'height' of the device: ";
  EXPECT_EQ(message(actuator(SSW_U8, 0, 8, 0, 0.01F, 0)),
            place + "the maximum 8 cannot be expressed: the u8 of scale 0.01 reach from 0 to 2.55");
  EXPECT_EQ(message(actuator(SSW_U16, -3, 8, 0, 1, 0)),
            place + "the minimum -3 cannot be expressed: the u16 of scale 1 reach from 0 to 65535");
  EXPECT_EQ(
      message(actuator(SSW_U8, 0.1F, 0.3F, 0.2F, 1, 0)),
      place +
          "the range 0.1 … 0.3 has no value that can be expressed: the u8 of scale 1 reach from 0 to 255");
  EXPECT_EQ(message(actuator(SSW_U8, 0, 25.5F, 0, 0.1F, 0)), "");
  EXPECT_EQ(message(actuator(SSW_U16, -10, 645.35F, 0, 0.01F, -10)), "");
  EXPECT_EQ(message(actuator(SSW_U8, 0.5F, 7.5F, 1, 1, 0)), "");
}

// What reaches the pins of that channel for that value, through the bridge and, `raw`, past it.
std::pair<unsigned, unsigned> commanded_raw(const ssw_channel& channel, float value, std::uint16_t raw) {
  DeviceLink link;
  EXPECT_EQ(describe(link, kOneCell, channel), Event::kDescribed) << link.message();
  Bytes down;
  link.write_frame(0, std::vector<float>(1, value), down);
  std::uint16_t active = 0, next = 0;
  ssd_channel own{channel, &active, &next};
  ssd_device device;
  ssd_init(
      &device, &kOneCell, &own, 1, [](void*, const std::uint8_t*, std::size_t) { return 1; }, nullptr);
  for (const std::uint8_t b : down) ssd_receive(&device, b);
  EXPECT_EQ(device.ready_tick, 0u);
  EXPECT_EQ(device.clamped, 0u) << "the bridge and the firmware agree";
  const unsigned through = next;
  std::uint8_t data[SSW_DATA_HEADER + 2] = {}, bytes[SSW_MAX_ENCODED + 2];
  ssw_put_u16(data + SSW_DATA_HEADER, raw);
  const ssw_packet packet{SSW_ACTUATOR_DATA, 0, 0, data, SSW_DATA_HEADER + ssw_dtype_bytes(channel.dtype)};
  const std::size_t count = ssw_write(&packet, bytes);
  for (std::size_t b = 0; b < count; ++b) ssd_receive(&device, bytes[b]);
  return {through, next};
}

TEST(DeviceLink, RawNumbersStayWithinTheRange) {
  using Raw = std::pair<unsigned, unsigned>;
  EXPECT_EQ(commanded_raw(actuator(SSW_U8, 0, 1, 0, 0.4F, 0), 1, 255), (Raw{2, 2})) << "3 is 1.2";
  EXPECT_EQ(commanded_raw(actuator(SSW_U8, 0.5F, 7.5F, 1, 1, 0), 8, 255), (Raw{7, 7}));
  EXPECT_EQ(commanded_raw(actuator(SSW_U8, 0.5F, 7.5F, 1, 1, 0), 0, 0), (Raw{1, 1}));
  EXPECT_EQ(commanded_raw(actuator(SSW_U16, -1, 1, 0, 0.3F, -1), 1, 60000), (Raw{6, 6}));
}

// Whether a multiple of the scale comes out above or below as f32.
TEST(DeviceLink, LimitsThatRawNumbersExpressAreKept) {
  for (const float scale : {0.001F, 0.007F, 0.01F, 0.02F, 0.1F, 0.3F, 1.7F})
    for (const float offset : {0.0F, -10.0F, 3.3F})
      for (unsigned raw = 1; raw < 255; ++raw) {
        const float value = offset + scale * static_cast<float>(raw);
        for (const float near : {value, std::nextafter(value, -99.0F), std::nextafter(value, 999.0F)}) {
          const ssw_channel up = actuator(SSW_U8, offset, near, offset, scale, offset);
          EXPECT_EQ(ssw_get_raw_range(&up).highest, static_cast<float>(raw)) << scale << " " << offset;
          const ssw_channel down = actuator(SSW_U8, near, 1000, near, scale, offset);
          EXPECT_EQ(ssw_get_raw_range(&down).lowest, static_cast<float>(raw)) << scale << " " << offset;
        }
      }
}

TEST(DeviceLink, FaultsAreReported) {
  Pair pair;
  pair.device.report("pin 3 is stuck\x01");
  ASSERT_EQ(pair.carry(), std::vector<Event>{Event::kFault});
  EXPECT_EQ(pair.link.message(), "pin 3 is stuck?");
}

}  // namespace
}  // namespace hardware
