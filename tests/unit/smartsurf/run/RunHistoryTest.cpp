#include "smartsurf/run/display/RunHistory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

namespace smartsurf::run {
namespace {

scene::Snapshot state(std::uint64_t tick) {
  scene::Snapshot s;
  s.tick = tick;
  s.height.assign(1000, static_cast<float>(tick));
  return s;
}

TEST(RunHistory, KeepsLatestTicksWithinLimit) {
  RunHistory past(10, 50'000);  // about eleven snapshots
  for (std::uint64_t tick = 0; tick < 5; ++tick) past.add(state(tick), {}, {});
  ASSERT_EQ(past.size(), 5u);
  EXPECT_EQ(past.at(0).snapshot.tick, 0u);
  for (std::uint64_t tick = 5; tick < 100; ++tick) past.add(state(tick), {}, {});
  ASSERT_GT(past.size(), 5u);
  ASSERT_LT(past.size(), 13u);
  for (std::size_t i = 0; i < past.size(); ++i) {
    EXPECT_EQ(past.at(i).snapshot.tick, 100u - past.size() + i);
    EXPECT_EQ(past.at(i).snapshot.height[0], static_cast<float>(past.at(i).snapshot.tick));
  }
  past.clear();
  EXPECT_EQ(past.size(), 0u);
  past.add(state(7), {}, {});
  EXPECT_EQ(past.at(0).snapshot.tick, 7u);
}

TEST(RunHistory, ReadsSignalsOfEveryStoredTick) {
  constexpr int kColumns = 10;
  RunHistory past(kColumns, 100'000);
  std::vector<float> reading(100);
  for (std::uint64_t tick = 0; tick < 60; ++tick) {
    scene::Snapshot s = state(tick);
    s.time_s = 0.1 * static_cast<double>(tick);
    s.height.resize(100);
    s.contact_count = static_cast<std::uint32_t>(2 * tick);
    for (std::size_t cell = 0; cell < reading.size(); ++cell)
      reading[cell] = static_cast<float>(100 * tick + cell);
    const view::Channel channels[] = {{"height", "u", s.height}, {"light", "lx", reading}};
    // The second metric begins late.
    const std::pair<std::string, double> metrics[] = {{"error", 0.5}, {"late", static_cast<double>(tick)}};
    past.add(s, channels, std::span(metrics).first(tick < 50 ? 1 : 2));
  }
  EXPECT_EQ(past.end(), 60u);
  const std::uint64_t begin = past.begin();
  const auto read = [&](const view::Signal& signal, std::uint64_t frame) {
    double value = 0.0;
    past.read(signal, frame, {&value, 1});
    return value;
  };
  using Kind = view::Signal::Kind;
  for (std::uint64_t frame = begin; frame < 60; ++frame) {
    EXPECT_EQ(read({Kind::kCell, "light", 0, 3, 7}, frame), static_cast<double>(100 * frame + 37));
    EXPECT_EQ(read({Kind::kCell, "height", 0, 3, 7}, frame), static_cast<double>(frame));
    EXPECT_EQ(read({Kind::kRun, "contacts", 0, 0, 0}, frame), static_cast<double>(2 * frame));
    EXPECT_EQ(read({Kind::kMetric, "error", 0, 0, 0}, frame), 0.5);
  }
  EXPECT_TRUE(std::isnan(read({Kind::kMetric, "late", 0, 0, 0}, 49)));
  EXPECT_EQ(read({Kind::kMetric, "late", 0, 0, 0}, 50), 50.0);
  EXPECT_TRUE(std::isnan(read({Kind::kCell, "no such", 0, 3, 7}, 50)));
  EXPECT_TRUE(std::isnan(read({Kind::kCell, "light", 0, 10, 0}, 50)));
  EXPECT_EQ(past.channel(past.at(past.size() - 1), 1)[5], 5905.0f);
  EXPECT_EQ(past.frame_at(5.55), 56u);
  EXPECT_EQ(past.frame_at(99.0), 60u);
  EXPECT_EQ(past.run_signals().size(), 4u);
  using scene::Metrics;
  EXPECT_EQ(past.metrics(past.at(past.frame_at(4.9) - begin)), (Metrics{{"error", 0.5}}));
  EXPECT_EQ(past.metrics(past.at(past.frame_at(5.5) - begin)), (Metrics{{"error", 0.5}, {"late", 55.0}}));
}

}  // namespace
}  // namespace smartsurf::run
