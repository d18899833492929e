// Large frames written in chunks: the reader gets the same bytes as without chunks.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numeric>
#include <thread>

#include "shm-protocol/src/ring/ChunkedTransfer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

SurfaceConfig large_surface(const std::string& what) {
  SurfaceConfig config;
  config.name = unique_name(what);
  config.rows = 300;
  config.columns = 301;  // 361 200 bytes: chunk and array ends do not coincide
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

TEST(ChunkedTransfer, ChunksAssembleTheCompleteFrame) {
  const auto config = large_surface("chunks");
  auto surface = SurfaceEndpoint::create(config);
  const std::size_t cells = surface.description().cells();
  constexpr std::uint64_t kTicks = 50;  // one for each length of chunks
  std::jthread other([&] {
    auto controller = ControllerEndpoint::attach(config.name);
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      ASSERT_TRUE(std::ranges::equal(controller.sensor(0), ramp(cells, static_cast<float>(tick))));
      const auto two = controller.sensor<std::uint8_t>(1);
      ASSERT_EQ(std::ranges::count(two, static_cast<std::uint8_t>(tick)), std::ranges::ssize(two));
      auto three = ramp(cells, static_cast<float>(2 * tick));
      three[5] = NAN;
      three[cells - 1] = 2e6f;
      const std::span<const float> all(three);
      const std::size_t chunk = 1000 + 977 * (tick % 50);
      for (std::size_t at = 0; at < cells; at += chunk)
        controller.write(2, at, all.subspan(at, std::min(chunk, cells - at)));
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
    ASSERT_EQ(surface.counters().clamped, 2 * (tick + 1));  // counted once each, although copied in chunks
  }
  other.join();
}

// Both sides stream: the controller answers each chunk on arrival; the surface receives answers while it is
// still writing.
class ChunksBothWays : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(ChunkedTransfer, ChunksBothWays, testing::Bool(),
                         [](const auto& of) { return of.param ? "InPlace" : "Copied"; });

TEST_P(ChunksBothWays, AnswersChunksBeforeFrameIsComplete) {
  auto config = large_surface("streaming");
  const bool in_place = GetParam();
  config.answers_in_place = in_place;
  auto surface = SurfaceEndpoint::create(config);
  const std::size_t cells = surface.description().cells();
  constexpr std::uint64_t kTicks = 50;
  std::jthread other([&] {
    auto controller = ControllerEndpoint::attach(config.name);
    std::vector<float> out(cells);
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      std::size_t at = 0;
      for (auto in = controller.next_cells(0); !in.empty(); in = controller.next_cells(0)) {
        for (std::size_t i = 0; i < in.size(); ++i) {
          ASSERT_EQ(in[i], static_cast<float>(tick + at + i));
          out[i] = in[i] == static_cast<float>(tick + 5) ? NAN : 2 * in[i];
        }
        controller.write(2, at, std::span<const float>(out).first(in.size()));
        at += in.size();
      }
      ASSERT_EQ(at, cells);
      ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      ASSERT_EQ(controller.sensor_info().tick, tick);
      ASSERT_TRUE(controller.next_cells(0).empty());  // already taken
      const std::vector<std::uint8_t> four(3 * cells, static_cast<std::uint8_t>(tick));
      controller.write(3, 0, std::span(four));
      ASSERT_EQ(controller.publish(), Status::kOk);
    }
  });
  ASSERT_EQ(surface.await_controller({.timeout = 60s}), Status::kOk);
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    const auto one = ramp(cells, static_cast<float>(tick));
    std::size_t taken = 0;
    const auto take = [&](std::span<const float> in) {
      for (const float v : in) {
        if (taken != 5) {
          ASSERT_EQ(v, static_cast<float>(2 * (tick + taken)));
        } else if (in_place) {
          ASSERT_TRUE(std::isnan(v));  // unchecked
        } else {
          ASSERT_EQ(v, 3.0f);
        }
        ++taken;
      }
    };
    for (std::size_t at = 0; at < cells; at += 4096) {
      surface.write(0, at, std::span(one).subspan(at, std::min<std::size_t>(4096, cells - at)));
      take(surface.next_cells(2));
    }
    const std::vector<std::uint8_t> two(cells, 1);
    surface.write(1, 0, std::span(two));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    for (auto in = surface.next_cells(2); !in.empty(); in = surface.next_cells(2)) take(in);
    ASSERT_EQ(taken, cells);
    ASSERT_EQ(surface.await_actuators(tick, {.timeout = 60s}), Status::kOk);
    if (!in_place) {
      ASSERT_EQ(surface.actuator(2)[5], 3.0f);
    }
    ASSERT_EQ(surface.actuator(2)[cells - 1], static_cast<float>(2 * (tick + cells - 1)));
    ASSERT_EQ(surface.actuator<std::uint8_t>(3)[3 * cells - 1], tick);
    ASSERT_EQ(surface.counters().clamped, in_place ? 0 : tick + 1);
  }
  other.join();
}

// Both sides of a large surface in one process.
struct LargePair {
  explicit LargePair(const std::string& what)
      : config(large_surface(what)), surface(SurfaceEndpoint::create(config)) {}
  void attach() {
    controller = std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(config.name));
  }
  // The first `cells` of the channel.
  void answer(float value, std::size_t cells) {
    controller->write(2, 0, std::span<const float>(std::vector<float>(cells, value)));
  }
  void answer_whole(float value) {
    answer(value, surface.description().cells());
    controller->write(
        3, 0, std::span<const std::uint8_t>(std::vector<std::uint8_t>(3 * surface.description().cells(), 1)));
  }
  bool actuator_matches(float value) {
    const auto all = surface.actuator(2);
    return std::ranges::count(all, value) == std::ranges::ssize(all);
  }

  SurfaceConfig config;
  SurfaceEndpoint surface;
  std::unique_ptr<ControllerEndpoint> controller;
};

TEST(ChunkedTransfer, RejectedAnswerDoesNotMixWithNext) {
  LargePair p("refused");
  ASSERT_EQ(p.surface.publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.surface.await_actuators(0, kNoWait), Status::kNoController);
  p.attach();
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  ASSERT_EQ(p.surface.publish(1, 0.0), Status::kOk);  // published before the controller attached
  p.answer(7, 40'000);
  ASSERT_EQ(p.surface.await_actuators(1, kNoWait), Status::kTimeout);  // copies the available chunks
  ASSERT_EQ(p.controller->publish(), Status::kTorn);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.answer_whole(8);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface.await_actuators(1, kNoWait), Status::kOk);
  EXPECT_TRUE(p.actuator_matches(8));
}

TEST(ChunkedTransfer, DetachedControllerDoesNotMixWithNext) {
  LargePair p("successor");
  p.attach();
  ASSERT_EQ(p.surface.await_controller(kNoWait), Status::kOk);
  ASSERT_EQ(p.surface.publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.answer(7, 40'000);
  const auto early = p.surface.next_cells(2, kNoWait);
  ASSERT_EQ(early.size(), 16'384u);
  EXPECT_EQ(early[0], 7);
  p.controller.reset();
  while (!p.surface.next_cells(2).empty()) {
  }  // takes the available part; the rest will never be written
  EXPECT_EQ(p.surface.await_actuators(0, kNoWait), Status::kControllerClosed);
  EXPECT_TRUE(p.actuator_matches(3));  // the safe values
  p.attach();
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.answer_whole(8);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface.await_actuators(0, kNoWait), Status::kOk);
  EXPECT_TRUE(p.actuator_matches(8));
}

// The user holds chunks of the predecessor when the successor's complete frame arrives.
TEST(ChunkedTransfer, ReportsInvalidatedActuatorChunks) {
  LargePair p("vain");
  p.attach();
  ASSERT_EQ(p.surface.await_controller(kNoWait), Status::kOk);
  ASSERT_EQ(p.surface.publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.answer(7, 40'000);
  ASSERT_EQ(p.surface.next_cells(2, kNoWait)[0], 7);
  p.controller.reset();
  p.attach();
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.answer_whole(8);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  EXPECT_EQ(p.surface.await_actuators(0, kNoWait), Status::kTorn);
  EXPECT_EQ(p.surface.next_cells(2, kNoWait)[0], 8);  // from the beginning
  ASSERT_EQ(p.surface.await_actuators(0, kNoWait), Status::kOk);
  EXPECT_TRUE(p.actuator_matches(8));
}

TEST(ChunkedTransfer, ReportsChunksOfAbandonedSensorFrame) {
  LargePair p("given-up");
  const std::vector<float> ones(p.surface.description().cells(), 1), twos(ones.size(), 2);
  p.surface.write(0, 0, std::span(ones).first(40'000));
  p.attach();
  const auto early = p.controller->next_cells(0, kNoWait);
  ASSERT_EQ(early.size(), 16'384u);
  EXPECT_EQ(early[0], 1);
  p.answer(7, 40'000);
  p.surface.write(0, 40'000, std::span(ones).subspan(40'000));
  ASSERT_EQ(p.surface.publish(0, 0.0), Status::kOk);
  {  // Simulates a surface that published before it adopted the controller.
    RawSegment raw(p.config.name);
    const auto process = raw.header().claim.controller_process;
    raw.header().claim.controller_process = 0;
    ASSERT_EQ(p.surface.await_actuators(0, kNoWait), Status::kNoController);
    raw.header().claim.controller_process = process;
  }
  p.surface.write(0, 0, std::span<const float>(twos));
  ASSERT_EQ(p.surface.publish(1, 0.0), Status::kOk);
  EXPECT_TRUE(p.controller->next_cells(0).empty());
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kTorn);
  EXPECT_EQ(p.controller->next_cells(0, kNoWait)[0], 2);  // from the beginning
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  EXPECT_EQ(p.controller->sensor_info().tick, 1u);
  p.answer_whole(8);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface.await_actuators(1, kNoWait), Status::kOk);
  EXPECT_TRUE(p.actuator_matches(8));
}

TEST(ChunkedTransfer, NoChunksOutOfTurnOrInPassiveMode) {
  LargePair p("turns");
  p.attach();
  EXPECT_TRUE(p.controller->next_cells(0, kNoWait).empty());  // there is no frame
  EXPECT_TRUE(p.surface.next_cells(2).empty());               // nothing was published: returns at once
  ASSERT_EQ(p.surface.publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.controller->next_cells(0, kNoWait).size(), 16'384u);  // written in place: completely available
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  EXPECT_TRUE(p.controller->next_cells(0).empty());  // the next frame requires our answer
  auto config = large_surface("chunks-passive");
  config.mode = Mode::kPassive;
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  ASSERT_EQ(surface.publish(0, 0.0), Status::kOk);
  EXPECT_TRUE(controller.next_cells(0).empty());
  EXPECT_TRUE(surface.next_cells(2).empty());
}

// Progress announces each chunk as soon as it is final, and nothing beyond it.
TEST(ChunkedTransfer, ProgressCoversFinalBytesOnly) {
  ssp_progress line{};
  alignas(64) static std::byte slot[400'000];
  ssp_channel a{}, b{};
  a.offset = 128, a.bytes = 100'001;
  b.offset = 100'160, b.bytes = 250'000;
  const std::vector<std::byte> values(250'000, std::byte{7});
  const std::uint32_t word = 0, waiting = 0;
  ChunkWriter writer(line, word, waiting, 350'032);
  const auto end = [&](std::uint32_t frame) { return committed_bytes(line, frame, sizeof slot); };
  EXPECT_EQ(end(9), 0u);
  writer.write(slot, 9, a, 0, std::span(values).first(100'001), false);
  EXPECT_EQ(end(8), 0u);  // another frame
  EXPECT_EQ(end(9), 100'129u / 64 * 64);
  writer.write(slot, 9, b, 150'000, std::span(values).first(90'000), false);  // leaves a gap: not announced
  EXPECT_EQ(end(9), 100'129u / 64 * 64);
  writer.write(slot, 9, b, 0, std::span(values).first(150'000), false);
  EXPECT_EQ(end(9), 250'160u / 64 * 64);
  writer.finish_frame(9);
  EXPECT_EQ(end(9), 250'160u / 64 * 64);
  writer.finish_frame(10);  // which was written in place
  EXPECT_EQ(end(9), 0u);
  EXPECT_EQ(end(9 + (1u << 24)), 0u);
  line.ready = encode_progress(4, ~std::uint64_t{0} >> 24);  // beyond the slot
  EXPECT_EQ(end(4), sizeof slot);
}

TEST(ChunkedTransfer, ReaderCopiesEachByteOnce) {
  ChunkReader reader;
  std::vector<std::pair<std::size_t, std::size_t>> taken;
  const auto follow = [&](std::uint32_t frame, std::uint32_t writer, std::size_t end) {
    return reader.copy_available(frame, writer, end,
                                 [&](std::size_t from, std::size_t to) { taken.emplace_back(from, to); });
  };
  EXPECT_FALSE(follow(4, 1, 0));
  EXPECT_TRUE(follow(4, 1, 100'096));
  EXPECT_TRUE(follow(4, 1, 100'096));
  EXPECT_FALSE(follow(4, 1, 100'096));
  EXPECT_EQ(taken, (std::vector<std::pair<std::size_t, std::size_t>>{{128, 65'664}, {65'664, 100'096}}));
  EXPECT_EQ(reader.finish(4, 1), 100'096u);
  EXPECT_EQ(reader.finish(4, 1), sizeof(ssp_slot));
  EXPECT_TRUE(follow(4, 1, 1024));
  EXPECT_TRUE(follow(4, 2, 1024));  // another writer: from the beginning
  EXPECT_EQ(reader.finish(4, 1), sizeof(ssp_slot));
  EXPECT_TRUE(follow(4, 2, 1024));
  EXPECT_EQ(reader.finish(5, 2), sizeof(ssp_slot));
}

}  // namespace
}  // namespace shm_protocol
