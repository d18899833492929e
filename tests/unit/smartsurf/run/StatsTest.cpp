#include "smartsurf/run/output/Stats.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

using namespace smartsurf::run;
using namespace std::chrono_literals;

TEST(DurationHistogram, QuantilesWithinTwoPercent) {
  DurationHistogram h;
  for (int i = 1; i <= 10000; ++i) h.add(std::chrono::microseconds(i));
  EXPECT_EQ(h.count(), 10000u);
  EXPECT_NEAR(h.quantile_ms(0.5), 5.0, 0.11);
  EXPECT_NEAR(h.quantile_ms(0.99), 9.9, 0.22);
  EXPECT_NEAR(h.total_s(), 50.005, 1e-6);
}

TEST(DurationHistogram, EmptyAndExtremes) {
  DurationHistogram h;
  EXPECT_EQ(h.quantile_ms(0.5), 0.0);
  h.add(0ns);
  h.add(std::chrono::hours(24 * 365));
  EXPECT_EQ(h.count(), 2u);
}

TEST(Stats, JsonHasDocumentedKeys) {
  RunSummary s;
  s.state_hash = 0xabcdef;
  s.simulated_s = 10;
  s.wall_s = 2;
  s.frames_drawn = 60;
  s.metrics = {{"error", 0.25}};
  const auto json = nlohmann::json::parse(to_json(s, PhaseTimes{}));
  EXPECT_EQ(json["state_hash"], "0000000000abcdef");
  EXPECT_EQ(json["real_time_factor"], 5.0);
  EXPECT_EQ(json["frames_drawn"], 60);
  EXPECT_TRUE(json["success"].is_null());
  EXPECT_TRUE(json["success_s"].is_null());
  EXPECT_FALSE(json.contains("purity"));
  EXPECT_EQ(json["metrics"]["error"], 0.25);
  for (const char* phase : {"wait", "actuate", "physics", "sense", "publish", "record", "render"})
    for (const char* key : {"median", "p99", "total_s"})
      EXPECT_TRUE(json["ms_per_tick"][phase].contains(key)) << phase;
}

TEST(Stats, NamesOfEarlierVersionsAreAliases) {
  RunSummary s;
  s.success = true;
  s.success_s = 22.5;
  s.metrics = {{"purity", 0.975}};
  const auto json = nlohmann::json::parse(to_json(s, PhaseTimes{}));
  EXPECT_EQ(json["success"], true);
  EXPECT_EQ(json["success_s"], 22.5);
  EXPECT_EQ(json["purity"], 0.975);
  EXPECT_EQ(json["sorted_at_s"], 22.5);
}

TEST(Stats, NamesThatAreNotUtf8AreReplaced) {
  RunSummary s;
  s.metrics = {{"\xb5m", 1.0}};
  const auto json = nlohmann::json::parse(to_json(s, PhaseTimes{}));
  EXPECT_EQ(json["metrics"].items().begin().key(), "\xef\xbf\xbdm");
}
