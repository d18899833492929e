// The bytes on the line: CRC, COBS, framing, and resynchronisation after noise.
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "shm-protocol/hardware/firmware/wire.h"

namespace hardware {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes encode(const Bytes& from) {
  Bytes to(from.size() + from.size() / 254 + 1);
  to.resize(ssw_cobs_encode(from.data(), from.size(), to.data()));
  return to;
}

struct Sent {
  std::uint8_t type, sequence;
  std::uint32_t tick;
  Bytes payload;
  bool operator==(const Sent&) const = default;
};

Bytes framed(const Sent& s) {
  Bytes to(SSW_MAX_ENCODED + 2);
  const ssw_packet packet{s.type, s.sequence, s.tick, s.payload.data(), s.payload.size()};
  to.resize(ssw_write(&packet, to.data()));
  return to;
}

std::vector<Sent> receive_all(const Bytes& stream, ssw_receiver& receiver) {
  std::vector<Sent> found;
  ssw_packet p;
  for (const std::uint8_t byte : stream)
    if (ssw_receive(&receiver, byte, &p))
      found.push_back({p.type, p.sequence, p.tick, Bytes(p.payload, p.payload + p.payload_bytes)});
  return found;
}

std::vector<Sent> receive_all(const Bytes& stream) {
  ssw_receiver receiver;
  ssw_receiver_init(&receiver);
  return receive_all(stream, receiver);
}

Bytes random_bytes(std::mt19937& random, std::size_t count) {
  Bytes bytes(count);
  // Many zeros and 255s, to exercise the stuffing.
  for (auto& b : bytes) b = random() % 3 == 0 ? 0 : static_cast<std::uint8_t>(random());
  return bytes;
}

Sent random_packet(std::mt19937& random) {
  return {static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()),
          static_cast<std::uint32_t>(random()), random_bytes(random, random() % (SSW_MAX_PAYLOAD + 1))};
}

// Bitwise reference implementation of the standard.
std::uint32_t slow_crc(const Bytes& bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (const std::uint8_t b : bytes)
    for (int bit = 0; bit < 8; ++bit) {
      const bool one = ((crc ^ (b >> bit)) & 1) != 0;
      crc = (crc >> 1) ^ (one ? 0xEDB88320 : 0);
    }
  return ~crc;
}

TEST(Wire, CheckIsTheStandardCrc32) {
  const std::string text = "123456789";
  EXPECT_EQ(ssw_crc32(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), 0xCBF43926u);
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const Bytes bytes = random_bytes(random, random() % 300);
    EXPECT_EQ(ssw_crc32(bytes.data(), bytes.size()), slow_crc(bytes));
  }
}

TEST(Wire, CobsMatchesPublishedExamples) {
  EXPECT_EQ(encode({}), (Bytes{1}));
  EXPECT_EQ(encode({0}), (Bytes{1, 1}));
  EXPECT_EQ(encode({0, 0}), (Bytes{1, 1, 1}));
  EXPECT_EQ(encode({0x11, 0x22, 0, 0x33}), (Bytes{3, 0x11, 0x22, 2, 0x33}));
  EXPECT_EQ(encode({0x11, 0, 0, 0}), (Bytes{2, 0x11, 1, 1, 1}));
  Bytes run(254);
  for (std::size_t i = 0; i < run.size(); ++i) run[i] = static_cast<std::uint8_t>(i + 1);
  Bytes stuffed = run;
  stuffed.insert(stuffed.begin(), 0xFF);
  EXPECT_EQ(encode(run), stuffed);
  run.push_back(0xFF);
  stuffed.insert(stuffed.end(), {2, 0xFF});
  EXPECT_EQ(encode(run), stuffed);
}

TEST(Wire, CobsRoundTripsWithoutZeros) {
  std::mt19937 random(2);
  for (std::size_t length = 0; length <= 1000; ++length) {
    const Bytes from = random_bytes(random, length);
    Bytes to = encode(from);
    EXPECT_EQ(std::count(to.begin(), to.end(), 0), 0);
    if (length <= SSW_MAX_PACKET) {
      EXPECT_EQ(to.size(), length + 1);
    }
    to.resize(ssw_cobs_decode(to.data(), to.size(), to.data()));  // in place
    EXPECT_EQ(to, from);
  }
}

TEST(Wire, PacketsRoundTrip) {
  std::mt19937 random(3);
  Bytes stream;
  std::vector<Sent> sent;
  for (int i = 0; i < 500; ++i) {
    sent.push_back(random_packet(random));
    const Bytes bytes = framed(sent.back());
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  }
  EXPECT_EQ(receive_all(stream), sent);
}

TEST(Wire, PacketBytesMatchDocumentation) {
  const Sent start{SSW_START, 7, 0x01020304, {}};
  // 12 07 04 03 02 01, then its CRC-32, little-endian.
  const std::uint32_t crc = slow_crc({0x12, 0x07, 0x04, 0x03, 0x02, 0x01});
  EXPECT_EQ(crc, 0x85E9A539u);
  EXPECT_EQ(framed(start), (Bytes{0, 0x0B, 0x12, 0x07, 0x04, 0x03, 0x02, 0x01, 0x39, 0xA5, 0xE9, 0x85, 0}));
}

TEST(Wire, RejectsOverlongPayload) {
  const Bytes payload(SSW_MAX_PAYLOAD + 1);
  Bytes to(SSW_MAX_ENCODED + 2);
  const ssw_packet packet{1, 0, 0, payload.data(), payload.size()};
  EXPECT_EQ(ssw_write(&packet, to.data()), 0u);
}

TEST(Wire, DetectsEveryBitFlip) {
  std::mt19937 random(4);
  const Sent sent{SSW_SENSOR_DATA, 9, 77, random_bytes(random, 60)};
  const Bytes good = framed(sent);
  for (std::size_t bit = 8; bit < (good.size() - 1) * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
    EXPECT_TRUE(receive_all(bad).empty()) << "bit " << bit;
  }
}

TEST(Wire, ResynchronisesAfterNoise) {
  std::mt19937 random(5);
  for (int i = 0; i < 3000; ++i) {
    Bytes stream = random_bytes(random, random() % 700);
    const Sent lost = random_packet(random), sent = random_packet(random);
    Bytes torn = framed(lost);
    torn.resize(random() % torn.size());  // a truncated packet
    stream.insert(stream.end(), torn.begin(), torn.end());
    const Bytes good = framed(sent);
    stream.insert(stream.end(), good.begin(), good.end());
    const auto found = receive_all(stream);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.back(), sent);
  }
}

TEST(Wire, NoiseYieldsNoPacket) {
  std::mt19937 random(6);
  ssw_receiver receiver;
  ssw_receiver_init(&receiver);
  EXPECT_TRUE(receive_all(random_bytes(random, 2'000'000), receiver).empty());
  EXPECT_GT(receiver.damaged, 100'000u);
  EXPECT_EQ(receiver.packets, 0u);
  // Without any zero, too: a line that is stuck.
  EXPECT_TRUE(receive_all(Bytes(100'000, 0x55), receiver).empty());
  const Sent sent{SSW_HEARTBEAT, 1, 2, {}};
  EXPECT_EQ(receive_all(framed(sent), receiver), std::vector<Sent>{sent});
}

// Damaged packets of all kinds: every packet received was sent, complete, and in that order.
TEST(Wire, DeliversOnlySentPackets) {
  std::mt19937 random(7);
  std::vector<Sent> sent;
  Bytes stream;
  for (int i = 0; i < 20'000; ++i) {
    sent.push_back(random_packet(random));
    Bytes bytes = framed(sent.back());
    for (auto& b : bytes)
      if (random() % 200 == 0) b ^= static_cast<std::uint8_t>(1u << (random() % 8));
    if (random() % 4 == 0) bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(random() % bytes.size()));
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  }
  const auto found = receive_all(stream);
  EXPECT_GT(found.size(), 3000u);
  auto next = sent.begin();
  for (const Sent& f : found) {
    next = std::find(next, sent.end(), f);
    ASSERT_NE(next, sent.end());
    ++next;
  }
}

TEST(Wire, DescriptionsRoundTrip) {
  const ssw_hello hello{SSW_VERSION, 3, 640, 480, 16'667, 1.25F, 0xDEADBEEF, "sixteen letters"};
  Sent sent{SSW_HELLO, 0, 0, Bytes(SSW_HELLO_BYTES)};
  ssw_put_hello(&hello, sent.payload.data());
  const ssw_packet packet{sent.type, 0, 0, sent.payload.data(), sent.payload.size()};
  ssw_hello back;
  ASSERT_TRUE(ssw_get_hello(&packet, &back));
  EXPECT_EQ(back.rows, 640);
  EXPECT_EQ(back.columns, 480);
  EXPECT_EQ(back.period_us, 16'667u);
  EXPECT_EQ(back.pitch, 1.25F);
  EXPECT_EQ(back.boot, 0xDEADBEEFu);
  EXPECT_STREQ(back.name, hello.name);
  const ssw_packet shorter{sent.type, 0, 0, sent.payload.data(), sent.payload.size() - 1};
  EXPECT_FALSE(ssw_get_hello(&shorter, &back));
}

}  // namespace
}  // namespace hardware
