#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/ActuatorArray.h"

using namespace smartsurf;

namespace {

constexpr double kFaultStep = 1.0 / 240;
const std::string kHeader = "row,column,channel,fault,value\n";

scene::SurfaceSpec pins(int rows, int columns) {
  scene::SurfaceSpec s;
  s.rows = rows;
  s.columns = columns;
  s.pin.min_height = 1;
  s.pin.max_height = 5;
  s.pin.max_acceleration = 1e5;
  s.pin.max_speed = 1e3;
  return s;
}

// Returns the heights after all pins have had time to reach `target`.
std::vector<float> heights(const scene::SurfaceSpec& s, float target, std::uint64_t seed = 1,
                           const std::string& csv = "") {
  const surface::FaultMap map =
      csv.empty() ? surface::FaultMap() : surface::FaultMap({"faults.csv", csv}, s.rows, s.columns);
  surface::ActuatorArray cells(s, map, seed);
  cells.set_targets(0, std::vector<float>(static_cast<std::size_t>(s.cell_count()), target));
  for (int i = 0; i < 60; ++i) {
    cells.begin_tick();
    cells.plan(kFaultStep);
    cells.commit(kFaultStep);
  }
  return cells.field().height;
}

// Two kinds of pins, in alternate columns, that share the channel `height`.
scene::SurfaceSpec mixed_pins(const std::vector<double>& first, const std::vector<double>& second) {
  scene::SurfaceSpec s = pins(20, 20);
  for (const auto& range : {first, second}) {
    s.actuators.push_back(scene::make_pin_actuator(s.pin));
    s.actuators.back().values["range"] = range;
  }
  for (int i = 0; i < s.cell_count(); ++i) s.actuator_of_cell.push_back(static_cast<std::int8_t>(i % 2));
  derive_pin_spec(s);
  return s;
}

// Indices of the cells whose height differs from `than`.
std::set<std::size_t> others(const std::vector<float>& heights, float than) {
  std::set<std::size_t> found;
  for (std::size_t i = 0; i < heights.size(); ++i)
    if (heights[i] != than) found.insert(i);
  return found;
}

// The message of the InputError that the fault map causes, or "".
std::string message(const std::string& csv, const scene::SurfaceSpec& s = pins(4, 5)) {
  try {
    const surface::FaultMap map({"faults.csv", csv}, s.rows, s.columns);
    map.require_channels({"height", "proximity"});
    surface::ActuatorArray(s, map, 1);
  } catch (const scene::InputError& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST(ActuatorFaults, AffectConfiguredFractionOfCells) {
  scene::SurfaceSpec s = pins(20, 20);
  s.faults.actuator.dead_fraction = 0.05;
  EXPECT_EQ(others(heights(s, 4), 4).size(), 20u);
  s.faults.actuator.weak_fraction = 0.1;
  s.faults.actuator.weak_gain = 0.5;
  const std::vector<float> h = heights(s, 4);
  EXPECT_EQ(std::ranges::count(h, 1.0F), 20);
  EXPECT_EQ(std::ranges::count(h, 2.5F), 40) << "halfway from 1 to 4";
}

TEST(ActuatorFaults, DependOnSeedAndGrowWithFraction) {
  scene::SurfaceSpec s = pins(20, 20);
  s.faults.actuator.stuck_fraction = 0.1;
  const auto some = others(heights(s, 4), 4);
  EXPECT_EQ(heights(s, 4), heights(s, 4));
  EXPECT_NE(some, others(heights(s, 4, 2), 4));
  s.faults.actuator.stuck_fraction = 0.2;
  const auto more = others(heights(s, 4), 4);
  EXPECT_EQ(more.size(), 80u);
  EXPECT_TRUE(std::ranges::includes(more, some));
}

TEST(ActuatorFaults, StuckCellsStartAtRandomHeights) {
  scene::SurfaceSpec s = pins(20, 20);
  s.faults.actuator.stuck_fraction = 1.0;
  const surface::ActuatorArray cells(s);
  const auto [low, high] = std::ranges::minmax(cells.field().height);
  EXPECT_GE(low, 1.0F);
  EXPECT_LE(high, 5.0F);
  EXPECT_GT(high - low, 3.5F);
}

TEST(ActuatorFaults, LatencyDelaysEveryCell) {
  scene::SurfaceSpec s = pins(1, 1);
  s.faults.actuator.latency_ticks = 2;
  surface::ActuatorArray cells(s);
  std::vector<float> seen;
  for (int tick = 0; tick < 5; ++tick) {
    cells.set_target(0, 0, 0, 3);
    cells.begin_tick();
    for (int i = 0; i < 4; ++i) {
      cells.plan(kFaultStep);
      cells.commit(kFaultStep);
    }
    seen.push_back(cells.field().height[0]);
  }
  EXPECT_EQ(seen, (std::vector<float>{1, 1, 3, 3, 3}));
}

TEST(ActuatorFaults, CellsOfTwoKindsHaveTheirOwnSafeValues) {
  using Range = std::vector<double>;
  for (const auto& [first, second] :
       {std::pair(Range{5, 8}, Range{0, 4}), std::pair(Range{0, 4}, Range{5, 8}),
        std::pair(Range{2, 8}, Range{0, 6}), std::pair(Range{0, 6}, Range{2, 8})}) {
    const auto expect = [&](const scene::SurfaceSpec& s, float target, double gain,
                            const std::string& csv = "") {
      const std::vector<float> h = heights(s, target, 1, csv);
      for (std::size_t i = 0; i < 2; ++i) {
        const Range& own = i == 0 ? first : second;
        const double command = std::clamp(static_cast<double>(target), own[0], own[1]);
        EXPECT_FLOAT_EQ(h[i], static_cast<float>(gain > 0 ? gain * command + (1 - gain) * own[0] : own[0]))
            << csv << i;
      }
    };
    scene::SurfaceSpec s = mixed_pins(first, second);
    expect(s, std::numeric_limits<float>::quiet_NaN(), 0);
    expect(s, static_cast<float>(s.actuator_channels()[0].safe_value), 0);
    expect(s, 6, 0, kHeader + "0,0,height,dead,\n0,1,height,dead,\n");
    expect(s, 6, 0.5, kHeader + "0,0,height,weak,0.5\n0,1,height,weak,0.5\n");
    s.faults.actuator.dead_fraction = 1;
    expect(s, 6, 0);
    s.faults.actuator = {.weak_fraction = 1, .weak_gain = 0.25};
    expect(s, 6, 0.25);
  }
}

TEST(ActuatorFaults, CellsOfTwoKindsAreStuckInTheirOwnRanges) {
  scene::SurfaceSpec s = mixed_pins({0, 8}, {1, 2});
  EXPECT_EQ(message(kHeader + "0,1,height,stuck,7\n", s),
            "faults.csv:2: value of 'stuck' = 7: must be in [1, 2]");
  EXPECT_EQ(message(kHeader + "0,0,height,stuck,7\n", s), "");
  s.faults.actuator.stuck_fraction = 1;
  const std::vector<float> h = heights(s, 0);
  double sum[2] = {};
  for (std::size_t i = 0; i < h.size(); ++i) sum[i % 2] += static_cast<double>(h[i]) / 200;
  EXPECT_NEAR(sum[0], 4.0, 0.6);
  EXPECT_NEAR(sum[1], 1.5, 0.08);
}

// An entry of all channels is one of those that the cell has.
TEST(ActuatorFaults, EntryWithoutChannelConcernsTheCellsOwn) {
  scene::SurfaceSpec s = mixed_pins({0, 8}, {1, 2});
  s.actuators[1] = scene::find_actuator_kind("ball")->default_spec();
  derive_pin_spec(s);
  EXPECT_EQ(message(kHeader + "0,1,,stuck,20\n", s), "");
  EXPECT_EQ(message(kHeader + "0,0,,stuck,20\n", s),
            "faults.csv:2: value of 'stuck' = 20: must be in [0, 8]");
}

TEST(FaultMap, FaultsIndividualCells) {
  const scene::SurfaceSpec s = pins(4, 5);
  const auto h = heights(
      s, 4, 1,
      "# measured on Tuesday\n" + kHeader +
          "0,1,height,stuck,2.5\r\n 1 , 2 , height , dead ,\n2,3,,weak,0.5\n\n3,4,height,late,1000\n");
  EXPECT_EQ(others(h, 4), (std::set<std::size_t>{1, 7, 13, 19}));
  EXPECT_EQ(h[1], 2.5F);
  EXPECT_EQ(h[7], 1.0F);
  EXPECT_EQ(h[13], 2.5F);
  EXPECT_EQ(h[19], 1.0F) << "still waiting";
}

TEST(FaultMap, RejectsInvalidFileWithOneLine) {
  EXPECT_EQ(message(""), "faults.csv: no header; the first line must be row,column,channel,fault,value");
  EXPECT_EQ(message("0,1,height,dead,\n"),
            "faults.csv:1: the first line must be the header row,column,channel,fault,value");
  EXPECT_EQ(message(kHeader + "4,0,height,dead,\n"), "faults.csv:2: row = '4': must be 0 to 3");
  EXPECT_EQ(message(kHeader + "0,x,height,dead,\n"), "faults.csv:2: column = 'x': must be 0 to 4");
  EXPECT_EQ(message(kHeader + "0,0,hight,dead,\n"),
            "faults.csv:2: channel 'hight': no such channel (did you mean 'height'?)");
  EXPECT_EQ(message(kHeader + "0,0,height,ded,\n"),
            "faults.csv:2: fault 'ded': not a fault of an actuator (did you mean 'dead'?)");
  EXPECT_EQ(message(kHeader + "0,0,height,stuck,\n"),
            "faults.csv:2: value of 'stuck' is missing: must be in [1, 5]");
  EXPECT_EQ(message(kHeader + "0,0,height,late,1.5\n"),
            "faults.csv:2: value of 'late' = 1.5: must be a whole number, 0 to 1000");
  EXPECT_EQ(message(kHeader + "0,0,height,stuck,nan\n"),
            "faults.csv:2: value = 'nan': must be a finite number");
  EXPECT_EQ(message(kHeader + "0,0,height,dead,\n1,0,height,dead,\n0,0,height,stuck,2\n"),
            "faults.csv:4: fault 'stuck': the cell is dead already, by line 2");
  EXPECT_EQ(message(kHeader + "0,0,\"height,dead,\n"), "faults.csv:2: a quotation mark is not closed");
  EXPECT_EQ(message(kHeader + "0,0\n"), "faults.csv:2: 2 values: must be 5, row,column,channel,fault,value");
}

TEST(FaultMap, SurvivesRandomBytes) {
  std::uint32_t state = 1;
  for (int i = 0; i < 2000; ++i) {
    std::string csv = i % 2 ? kHeader : "";
    for (int k = 0; k < 40; ++k) {
      state = state * 1664525u + 1013904223u;
      csv += "0123,.\n\r#-e\"weakstuck\xff"[(state >> 16) % 22];
    }
    message(csv);
  }
}
