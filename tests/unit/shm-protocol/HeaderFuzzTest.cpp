// Corrupt headers yield an error or a working endpoint, never a crash; and a surface survives a controller
// that overwrites its segment.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include <cmath>
#include <random>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

std::vector<std::uint8_t> good_segment(Mode mode) {
  const auto config = small_surface(unique_name("good"), mode);
  auto surface = SurfaceEndpoint::create(config);
  EXPECT_EQ(surface.publish(1, 0.0), Status::kOk);
  return RawSegment(config.name).copy();
}

// Accesses every array of an endpoint that attached despite the mutation.
void use(ControllerEndpoint& controller) {
  (void)controller.await_sensors({.timeout = 0ns});
  (void)controller.latest_sensors();
  volatile std::uint8_t sink = 0;
  const auto& channels = controller.description().channels;
  for (int c = 0; c < static_cast<int>(channels.size()); ++c) {
    const bool sensor = channels[static_cast<std::size_t>(c)].direction == Direction::kSensor;
    switch (channels[static_cast<std::size_t>(c)].dtype) {
      case DType::kF32:
        if (sensor)
          sink = static_cast<std::uint8_t>(controller.sensor(c).back() > 0);
        else
          controller.actuator(c).back() = 1;
        break;
      case DType::kU32:
        if (sensor)
          sink = static_cast<std::uint8_t>(controller.sensor<std::uint32_t>(c).back());
        else
          controller.actuator<std::uint32_t>(c).back() = 1;
        break;
      case DType::kU8:
        if (sensor)
          sink = controller.sensor<std::uint8_t>(c).back();
        else
          controller.actuator<std::uint8_t>(c).back() = 1;
        break;
    }
  }
  (void)sink;
  (void)controller.publish();
}

TEST(HeaderFuzz, MutatedHeadersAreErrorsOrHarmless) {
  std::mt19937 random(20240501);
  int refused = 0, accepted = 0, corrupt = 0;
  for (const Mode mode : {Mode::kTimeStep, Mode::kPassive}) {
    const auto good = good_segment(mode);
    const std::size_t used = 4096 + 6 * 128;
    ForgedSegment forged(unique_name("fuzz"), good);
    for (int i = 0; i < 2500; ++i) {
      auto bytes = good;
      for (auto n = random() % 6 + 1; n > 0; --n) {
        // Half of the mutations hit the two lines that hold all sizes and offsets.
        const std::size_t where = random() % 2 ? random() % 256 : random() % used;
        bytes[where] = static_cast<std::uint8_t>(random() % 3 ? random() : random() % 2 * 255);
      }
      if (random() % 8 == 0) bytes.resize(random() % bytes.size());
      forged.write(bytes);
      try {
        auto controller = ControllerEndpoint::attach(forged.name());
        use(controller);
        ++accepted;
      } catch (const Error& e) {
        ++refused;
        corrupt += e.code() == ErrorCode::kCorrupt;
        EXPECT_NE(std::string(e.what()), "");
      }
    }
  }
  EXPECT_GT(refused, 2000);
  EXPECT_GT(corrupt, 1000);
  EXPECT_GT(accepted, 100);
}

TEST(HeaderFuzz, RehashedHeadersRequireValidSizes) {
  // The hash keeps accidents out; whoever forges can compute it. So forge it: only the checks of sizes are
  // left.
  std::mt19937 random(7);
  const auto good = good_segment(Mode::kPassive);
  ForgedSegment forged(unique_name("rehash"), good);
  int refused = 0, accepted = 0;
  for (int i = 0; i < 3000; ++i) {
    auto bytes = good;
    for (auto n = random() % 3 + 1; n > 0; --n) {
      const std::size_t where = random() % 2 ? 128 + random() % 96 : 4096 + random() % (6 * 128);
      bytes[where] = static_cast<std::uint8_t>(random() % 2 ? random() : bytes[where] ^ (1u << random() % 8));
    }
    std::uint64_t hash = 0xCBF29CE484222325;
    const auto add = [&](std::size_t from, std::size_t count) {
      for (std::size_t k = from; k < from + count; ++k) hash = (hash ^ bytes[k]) * 0x100000001B3;
    };
    add(128, 128);
    add(4096, 6 * 128);
    std::memcpy(&bytes[40], &hash, sizeof hash);
    forged.write(bytes);
    try {
      auto controller = ControllerEndpoint::attach(forged.name());
      use(controller);
      ++accepted;
    } catch (const Error& e) {
      ++refused;
      EXPECT_EQ(e.code(), ErrorCode::kCorrupt) << e.what();
    }
  }
  EXPECT_GT(refused, 500);
  EXPECT_GT(accepted, 500);
}

TEST(HeaderFuzz, EveryTruncationIsCorrupt) {
  const auto good = good_segment(Mode::kTimeStep);
  ForgedSegment forged(unique_name("cut"), good);
  for (const std::size_t size : {0ul, 1ul, 8ul, 127ul, 128ul, 4095ul, 4096ul, 5000ul, good.size() - 1}) {
    forged.write({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)});
    EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(forged.name()); }), ErrorCode::kCorrupt) << size;
  }
}

TEST(HeaderFuzz, SurfaceSurvivesHostileController) {
  for (const Mode mode : {Mode::kTimeStep, Mode::kPassive}) {
    const auto config = small_surface(unique_name("scribble"), mode);
    auto surface = SurfaceEndpoint::create(config);
    RawSegment raw(config.name);
    std::mt19937 random(99);
    for (int i = 0; i < 3000; ++i) {
      for (int n = 0; n < 50; ++n) {
        // The headers, the words and the actuator ring's slots.
        const std::size_t where = random() % 2 ? 128 + random() % 5000 : random() % raw.size();
        raw.data()[where] = static_cast<std::uint8_t>(random());
      }
      raw.header().actuators.word += 1;
      raw.header().actuators.answers = static_cast<std::uint64_t>(i + 1);
      raw.header().actuators.frame = raw.header().actuators.word;
      raw.actuator_slot(raw.header().actuators.word).sequence =
          2 * std::uint64_t{raw.header().actuators.word};
      (void)surface.publish(static_cast<std::uint64_t>(i), 0.0);
      (void)surface.await_actuators(static_cast<std::uint64_t>(i), {.timeout = 0ns});
      (void)surface.latest_actuators();
      surface.sensor(kDistance)[0] = 1.0f;
      for (const float v : surface.actuator(kHeight))
        ASSERT_TRUE(std::isfinite(v) && v >= -1.0f && v <= 4.0f);
      for (const auto v : surface.actuator<std::uint8_t>(kLamp)) ASSERT_LE(v, 100);
    }
  }
}

}  // namespace
}  // namespace shm_protocol
