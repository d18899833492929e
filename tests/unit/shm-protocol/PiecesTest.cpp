// Large frames written piece by piece: the reader ends with the same bytes as by any other way.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <thread>

#include "shm-protocol/src/Pieces.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

SurfaceConfig large_surface(const std::string& what) {
  SurfaceConfig config;
  config.name = unique_name(what);
  config.rows = 300;
  config.columns = 301;  // 361 200 bytes: pieces and arrays end anywhere
  config.period_ns = 1'000'000;
  config.channels = {{"one", Direction::kSensor, DType::kF32, 1, "", 0, 1e7, 0},
                     {"two", Direction::kSensor, DType::kU8, 1, "", 0, 255, 0},
                     {"three", Direction::kActuator, DType::kF32, 1, "", 0, 1e6, 3},
                     {"four", Direction::kActuator, DType::kU8, 3, "", 0, 200, 0}};
  return config;
}

std::vector<float> ramp(std::size_t cells, float from) {
  std::vector<float> values(cells);
  std::iota(values.begin(), values.end(), from);
  return values;
}

TEST(Pieces, AreCopiedAlongAndEndAsTheWholeFrame) {
  const auto config = large_surface("pieces");
  auto surface = SurfaceEndpoint::create(config);
  const std::size_t cells = surface.description().cells();
  constexpr std::uint64_t kTicks = 200;
  std::thread other([&] {
    auto controller = ControllerEndpoint::attach(config.name);
    controller.take_copies();
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      ASSERT_TRUE(std::ranges::equal(controller.sensor(0), ramp(cells, static_cast<float>(tick))));
      const auto two = controller.sensor<std::uint8_t>(1);
      ASSERT_EQ(std::ranges::count(two, static_cast<std::uint8_t>(tick)), std::ranges::ssize(two));
      auto three = ramp(cells, static_cast<float>(2 * tick));
      three[5] = NAN;
      three[cells - 1] = 2e6f;
      const std::span<const float> all(three);
      const std::size_t piece = 1000 + 977 * (tick % 50);
      for (std::size_t at = 0; at < cells; at += piece)
        controller.write(2, at, all.subspan(at, std::min(piece, cells - at)));
      const std::vector<std::uint8_t> four(3 * cells, static_cast<std::uint8_t>(tick));
      controller.write(3, 0, std::span(four));
      ASSERT_EQ(controller.publish(), Status::kOk);
    }
  });
  ASSERT_EQ(surface.await_controller({.timeout = 60s}), Status::kOk);
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    const auto one = ramp(cells, static_cast<float>(tick));
    surface.write(0, 0, std::span<const float>(one));
    const std::vector<std::uint8_t> two(cells, static_cast<std::uint8_t>(tick));
    surface.write(1, 0, std::span(two));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    ASSERT_EQ(surface.await_actuators(tick, {.timeout = 60s}), Status::kOk);
    auto expected = ramp(cells, static_cast<float>(2 * tick));
    expected[5] = 3;
    expected[cells - 1] = 1e6f;
    ASSERT_TRUE(std::ranges::equal(surface.actuator(2), expected)) << tick;
    const auto four = surface.actuator<std::uint8_t>(3);
    ASSERT_EQ(std::ranges::count(four, static_cast<std::uint8_t>(tick)), std::ranges::ssize(four));
    ASSERT_EQ(surface.counters().clamped, 2 * (tick + 1));  // each counted once, though copied in pieces
  }
  other.join();
}

// Each piece is taken as soon as it is announced, none twice and none past what was announced.
TEST(Pieces, ReaderFollowsTheWriterExactly) {
  ssp_progress line{};
  alignas(64) static std::byte slot[400'000];
  ssp_channel a{}, b{};
  a.offset = 128, a.bytes = 100'001;
  b.offset = 100'160, b.bytes = 250'000;
  const std::vector<std::byte> values(250'000, std::byte{7});
  const std::uint32_t word = 0, waiting = 0;
  PieceWriter writer(line, word, waiting);
  PieceReader reader(line);
  std::vector<std::pair<std::size_t, std::size_t>> taken;
  const auto look = [&](std::uint32_t frame) {
    reader.look(frame, 1, sizeof slot,
                [&](std::size_t from, std::size_t to) { taken.emplace_back(from, to); });
  };
  look(9);
  EXPECT_TRUE(taken.empty());
  writer.write(slot, 9, a, 0, std::span(values).first(100'001), false);
  look(8);
  EXPECT_TRUE(taken.empty());  // another frame
  look(9);
  look(9);
  EXPECT_EQ(taken, (std::vector<std::pair<std::size_t, std::size_t>>{{128, 100'096}}));
  writer.write(slot, 9, b, 150'000, std::span(values).first(100'000), false);  // leaves a gap: says nothing
  look(9);
  EXPECT_EQ(taken.size(), 1u);
  writer.write(slot, 9, b, 0, std::span(values).first(150'000), false);
  look(9);
  look(9);
  look(9);
  EXPECT_EQ(taken.back().second, 250'160u / 64 * 64);
  EXPECT_EQ(taken.front().second, taken[1].first);
  EXPECT_EQ(reader.finish(9, 1), 250'160u / 64 * 64);
  EXPECT_EQ(reader.finish(9, 1), sizeof(ssp_slot));
}

TEST(Pieces, OfAnotherWriterOrFrameAreNotKept) {
  ssp_progress line{progress_word(4, 200'000), {}};
  PieceReader reader(line);
  int looks = 0;
  reader.look(4, 1, 400'000, [&](std::size_t, std::size_t) { ++looks; });
  EXPECT_EQ(looks, 1);
  EXPECT_EQ(reader.finish(4, 2), sizeof(ssp_slot));
  reader.look(4, 1, 400'000, [&](std::size_t, std::size_t) { ++looks; });
  EXPECT_EQ(reader.finish(5, 1), sizeof(ssp_slot));
  line.ready = progress_word(4, ~std::uint64_t{0} >> 24);  // more than there is
  std::size_t end = 0;
  for (int i = 0; i < 9; ++i) reader.look(4, 1, 400'000, [&](std::size_t, std::size_t to) { end = to; });
  EXPECT_EQ(end, 400'000u);
}

}  // namespace
}  // namespace shm_protocol
