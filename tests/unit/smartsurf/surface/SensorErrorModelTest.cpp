#include "smartsurf/surface/sensors/SensorErrorModel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "smartsurf/surface/sensors/CounterRandom.h"
#include "tests/unit/smartsurf/surface/SensorFixture.h"

using namespace smartsurf;
using surface::CounterRandom;
using surface::error_message_of;
using surface::FaultMap;
using surface::SensorArray;
using surface::SensorFixture;

namespace {

// A proximity sensor 3 u below a large level plate: only sensor errors make readings differ from 3.
struct Plate : SensorFixture {
  explicit Plate(const scene::ParameterValues& errors, int rows = 40, int columns = 50)
      : SensorFixture(rows, columns) {
    scene::ObjectSpec plate;
    plate.shape = scene::ShapeKind::kBox;
    plate.size = {200, 200, 2};
    plate.position = {25, 20, 4};
    add(plate);
    add_sensor("proximity", errors);
  }
  std::vector<float> read(SensorArray& s, int channel = 0) {
    s.sense(snapshot, catalogue, pool);
    return {s.readings(channel).begin(), s.readings(channel).end()};
  }
};

struct SampleStatistics {
  double mean = 0, deviation = 0;
};
template <class Numbers>
SampleStatistics statistics_of(const Numbers& numbers) {
  SampleStatistics m;
  for (const double x : numbers) m.mean += x / static_cast<double>(numbers.size());
  for (const double x : numbers)
    m.deviation += (x - m.mean) * (x - m.mean) / static_cast<double>(numbers.size());
  m.deviation = std::sqrt(m.deviation);
  return m;
}

scene::CalibrationFile calibration(const std::string& rows) {
  return {"calib.csv", "row,column,channel,gain,offset\n" + rows};
}

FaultMap fault_map(const std::string& rows) {
  return FaultMap({"faults.csv", "row,column,channel,fault,value\n" + rows}, 40, 50);
}

}  // namespace

TEST(CounterRandom, HasExpectedDistributionsAndDependsOnKeys) {
  const CounterRandom random(1, 2, 3);
  std::vector<double> normal, uniform;
  for (std::uint64_t i = 0; i < 100'000; ++i) {
    normal.push_back(random.normal(i));
    uniform.push_back(random.uniform(i));
  }
  EXPECT_NEAR(statistics_of(normal).mean, 0.0, 0.01);
  EXPECT_NEAR(statistics_of(normal).deviation, 1.0, 0.01);
  const auto beyond = [&](double x) {
    return static_cast<double>(std::ranges::count_if(normal, [x](double n) { return n > x; })) / 1e5;
  };
  EXPECT_NEAR(beyond(1.0), 0.1587, 0.004);
  EXPECT_NEAR(beyond(2.0), 0.0228, 0.002);
  EXPECT_NEAR(beyond(3.0), 0.00135, 0.0005);
  EXPECT_NEAR(beyond(-1.0), 0.8413, 0.004);
  EXPECT_NEAR(statistics_of(uniform).mean, 0.5, 0.004);
  EXPECT_EQ(CounterRandom(1, 2, 3).bits(7), random.bits(7));
  for (const auto& other : {CounterRandom(2, 2, 3), CounterRandom(1, 3, 3), CounterRandom(1, 2, 4)})
    EXPECT_NE(other.bits(7), random.bits(7));
}

TEST(SensorErrorModel, WithoutErrorsReadingsAliasTruth) {
  Plate p({});
  SensorArray s = p.sensors();
  p.read(s);
  EXPECT_EQ(s.readings(0).data(), s.truth(0).data());
  EXPECT_EQ(s.readings(0)[0], 3.0F);
}

TEST(SensorErrorModel, NoiseHasConfiguredDeviationAndKeepsTruth) {
  Plate p({{"noise", {0.1}}});
  SensorArray s = p.sensors();
  const auto first = p.read(s), second = p.read(s);
  EXPECT_NEAR(statistics_of(first).mean, 3.0, 0.01);
  EXPECT_NEAR(statistics_of(first).deviation, 0.1, 0.01);
  EXPECT_NE(first, second);
  EXPECT_EQ(s.truth(0)[0], 3.0F);
  SensorArray again = p.sensors(), other = p.sensors({}, 2);
  EXPECT_EQ(p.read(again), first);
  EXPECT_NE(p.read(other), first);
}

TEST(SensorErrorModel, NoErrorsWhereNothingIsDetected) {
  SensorFixture t;
  t.add_sensor("proximity", {{"noise", {1}}, {"drift", {1}}});
  SensorArray s = t.sensors();
  for (int i = 0; i < 3; ++i) s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(std::ranges::count(s.readings(0), 8.0F), t.spec.cell_count());
}

TEST(SensorErrorModel, ReadingsStayWithinChannelRange) {
  Plate p({{"noise", {50}}});
  SensorArray s = p.sensors();
  const auto read = p.read(s);
  EXPECT_GE(std::ranges::min(read), 0.0F);
  EXPECT_LE(std::ranges::max(read), 8.0F);
}

TEST(SensorErrorModel, QuantizedReadingsAreMultiplesOfStep) {
  Plate p({{"noise", {0.5}}, {"quantize", {0.25}}});
  SensorArray s = p.sensors();
  for (const float x : p.read(s)) EXPECT_EQ(x, std::round(x * 4) / 4);
}

TEST(SensorErrorModel, DriftIsRandomWalkWithConfiguredDeviation) {
  Plate p({{"drift", {0.2}}});
  SensorArray s = p.sensors();
  EXPECT_EQ(p.read(s)[0], 3.0F);
  std::vector<float> last;
  for (int tick = 0; tick < 60; ++tick) last = p.read(s);
  EXPECT_NEAR(statistics_of(last).deviation, 0.2, 0.02);
  EXPECT_NEAR(statistics_of(last).mean, 3.0, 0.03);
  const auto next = p.read(s);
  EXPECT_LT(std::abs(next[7] - last[7]), 0.2F * 6 / std::sqrt(60.0F));
}

TEST(SensorErrorModel, LatencyDelaysReadings) {
  Plate p({{"latency", {2}}});
  SensorArray s = p.sensors();
  std::vector<float> seen;
  for (int tick = 0; tick < 6; ++tick) {
    p.snapshot.position[0][2] = 4.0F + static_cast<float>(tick);
    seen.push_back(p.read(s)[0]);
  }
  EXPECT_EQ(seen, (std::vector<float>{3, 3, 3, 4, 5, 6}));
}

TEST(SensorErrorModel, DropoutReadsAsNoDetection) {
  Plate p({{"dropout", {0.1}}});
  SensorArray s = p.sensors();
  const auto first = p.read(s);
  const auto lost = std::ranges::count(first, 8.0F);
  EXPECT_NEAR(static_cast<double>(lost) / static_cast<double>(first.size()), 0.1, 0.02);
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(s.readings(1)[i], first[i] == 8.0F ? 0.0F : 1.0F);
  EXPECT_NE(p.read(s), first);
}

// The measured distance d + σ·N misses the range with probability Φ((d − range)/σ). The interval is 5
// standard deviations of the binomial distribution.
TEST(SensorErrorModel, NoiseBeyondRangeIsAMiss) {
  constexpr int kTicks = 20;
  for (const double sigmas : {0.0, 0.5, 1.0, 2.0}) {
    Plate p({{"noise", {0.1}}});
    p.snapshot.position[0][2] = static_cast<float>(9.0 - 0.1 * sigmas - 1e-4);
    SensorArray s = p.sensors();
    double misses = 0, readings = 0;
    for (int tick = 0; tick < kTicks; ++tick) {
      const auto read = p.read(s);
      for (std::size_t i = 0; i < read.size(); ++i) {
        EXPECT_EQ(s.readings(1)[i], read[i] == 8.0F ? 0.0F : 1.0F);
        misses += read[i] == 8.0F;
        ++readings;
      }
      EXPECT_EQ(std::ranges::count(s.truth(1), 1.0F), p.spec.cell_count());
    }
    const double expected = 0.5 * std::erfc((sigmas + 1e-3) / std::sqrt(2.0));
    EXPECT_NEAR(misses / readings, expected, 5 * std::sqrt(expected * (1 - expected) / readings)) << sigmas;
  }
}

TEST(SensorErrorModel, FalseHitsAreUniformlyDistributed) {
  constexpr int kTicks = 20;
  SensorFixture t(40, 50);
  t.add_sensor("proximity", {{"false_hits", {0.1}}});
  SensorArray s = t.sensors();
  std::vector<double> distances;
  std::vector<float> first;
  for (int tick = 0; tick < kTicks; ++tick) {
    s.sense(t.snapshot, t.catalogue, t.pool);
    if (tick == 0) first.assign(s.readings(0).begin(), s.readings(0).end());
    for (std::size_t i = 0; i < s.readings(0).size(); ++i) {
      EXPECT_EQ(s.readings(1)[i], s.readings(0)[i] < 8.0F ? 1.0F : 0.0F);
      if (s.readings(0)[i] < 8.0F) distances.push_back(static_cast<double>(s.readings(0)[i]));
    }
    EXPECT_EQ(std::ranges::count(s.truth(1), 0.0F), t.spec.cell_count());
  }
  const double readings = 2000.0 * kTicks, hits = static_cast<double>(distances.size());
  EXPECT_NEAR(hits / readings, 0.1, 5 * std::sqrt(0.1 * 0.9 / readings));
  EXPECT_NEAR(statistics_of(distances).mean, 4.0, 5 * 8.0 / std::sqrt(12.0 * hits));
  EXPECT_NEAR(statistics_of(distances).deviation, 8.0 / std::sqrt(12.0), 0.1);
  SensorArray again = t.sensors(), other = t.sensors({}, 2);
  again.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_TRUE(std::ranges::equal(again.readings(0), first));
  other.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FALSE(std::ranges::equal(other.readings(0), first));
}

TEST(SensorErrorModel, QuantizedFalseHitsStayBelowTheRange) {
  SensorFixture t(40, 50);
  t.add_sensor("proximity", {{"false_hits", {1.0}}, {"quantize", {2.0}}, {"dropout", {0.5}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  for (const float distance : {0.0F, 2.0F, 4.0F, 6.0F})
    EXPECT_NEAR(static_cast<double>(std::ranges::count(s.readings(0), distance)) / 2000.0, 0.125,
                5 * std::sqrt(0.125 * 0.875 / 2000.0));
  EXPECT_EQ(std::ranges::count(s.readings(0), 8.0F), std::ranges::count(s.readings(1), 0.0F));
}

// What is detected is never replaced by a false hit.
TEST(SensorErrorModel, FalseHitsLeaveDetections) {
  Plate p({{"false_hits", {0.5}}});
  SensorArray s = p.sensors();
  EXPECT_EQ(std::ranges::count(p.read(s), 3.0F), p.spec.cell_count());
  EXPECT_EQ(std::ranges::count(s.readings(1), 1.0F), p.spec.cell_count());
}

TEST(SensorErrorModel, StuckAndDeadCellsPersist) {
  Plate p({{"stuck_low", {0.1}}, {"stuck_high", {0.05}}, {"dead", {0.02}}});
  SensorArray s = p.sensors();
  const auto first = p.read(s);
  const auto cells = static_cast<double>(first.size());
  EXPECT_NEAR(static_cast<double>(std::ranges::count(first, 0.0F)) / cells, 0.1, 0.02);
  EXPECT_NEAR(static_cast<double>(std::ranges::count(first, 8.0F)) / cells, 0.07, 0.02);
  p.snapshot.position[0][2] = 1e6F;
  const auto far = p.read(s);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(far[i], first[i] == 0.0F ? 0.0F : 8.0F);
    EXPECT_EQ(s.readings(1)[i], first[i] == 0.0F ? 1.0F : 0.0F);
  }
}

TEST(SensorErrorModel, LargerFractionIncludesSmaller) {
  std::vector<float> before;
  for (const double share : {0.1, 0.2, 0.3}) {
    Plate p({{"dead", {share}}});
    SensorArray s = p.sensors();
    const auto read = p.read(s);
    for (std::size_t i = 0; i < before.size(); ++i)
      if (before[i] == 8.0F) {
        EXPECT_EQ(read[i], 8.0F);
      }
    before = read;
  }
}

TEST(SensorErrorModel, SensorErrorsOverrideSharedErrors) {
  Plate p({{"noise", {0.0}}});
  p.spec.sensors.push_back(p.spec.sensors[0]);
  p.spec.sensors[1].name = "other";
  p.spec.sensors[1].values.erase("noise");
  p.spec.faults.sensor_errors["noise"] = {0.5};
  SensorArray s = p.sensors();
  p.read(s);
  EXPECT_EQ(std::ranges::count(s.readings(0), 3.0F), p.spec.cell_count());
  EXPECT_LT(std::ranges::count(s.readings(2), 3.0F), 3);
}

TEST(SensorErrorModel, ObjectClassesDropOutButHaveNoNoise) {
  Plate p({});
  p.spec.sensors.clear();
  p.add_sensor("object_type", {{"noise", {5}}, {"quantize", {3}}, {"dropout", {0.2}}});
  SensorArray s = p.sensors();
  const auto read = p.read(s);
  EXPECT_EQ(std::ranges::count(read, 0.0F) + std::ranges::count(read, 1.0F), p.spec.cell_count());
  EXPECT_GT(std::ranges::count(read, 0.0F), 200);
}

TEST(SensorErrorModel, CalibrationAppliesGainAndOffsetPerCell) {
  Plate p({});
  p.spec.sensors[0].calibration = calibration("# made on 3 May\n1,2,proximity,1.1,-0.2\n\n5,6,,2,0\n");
  SensorArray s = p.sensors();
  const auto read = p.read(s);
  EXPECT_FLOAT_EQ(read[static_cast<std::size_t>(p.spec.index(1, 2))], 3.1F);
  EXPECT_FLOAT_EQ(read[static_cast<std::size_t>(p.spec.index(5, 6))], 6.0F);
  EXPECT_EQ(read[static_cast<std::size_t>(p.spec.index(1, 3))], 3.0F);
}

TEST(SensorErrorModel, RejectsInvalidCalibrationWithOneLine) {
  const auto error = [](const std::string& rows) {
    Plate p({});
    p.spec.sensors[0].calibration = calibration(rows);
    return error_message_of([&] { p.sensors(); });
  };
  EXPECT_EQ(error("40,2,proximity,1,0\n"), "calib.csv:2: row = '40': must be 0 to 39");
  EXPECT_EQ(error("\n1,x,proximity,1,0\n"), "calib.csv:3: column = 'x': must be 0 to 49");
  EXPECT_EQ(error("1,2,proximity,nan,0\n"), "calib.csv:2: gain = 'nan': must be a finite number");
  EXPECT_EQ(error("1,2,proximity,1\n"), "calib.csv:2: 4 values: must be 5, row,column,channel,gain,offset");
  EXPECT_EQ(error("1,2,proximty,1,0\n"),
            "calib.csv:2: channel 'proximty': the sensor has no such channel to calibrate; known: proximity");
  Plate p({});
  p.spec.sensors[0].calibration = {"calib.csv", "a,b\n1,2\n"};
  EXPECT_EQ(error_message_of([&] { p.sensors(); }),
            "calib.csv:1: the first line must be the header row,column,channel,gain,offset");
  p.spec.sensors[0].calibration = {"calib.csv", ""};
  EXPECT_EQ(error_message_of([&] { p.sensors(); }),
            "calib.csv: no header; the first line must be row,column,channel,gain,offset");
}

TEST(SensorErrorModel, FaultMapAffectsIndividualCells) {
  Plate p({});
  SensorArray s = p.sensors(
      fault_map("0,1,proximity,stuck,2.5\n0,2,proximity,dead,\n0,3,,dead,\n0,4,proximity,stuck_low,\n"
                "0,5,proximity,gain,2\n0,6,proximity,offset,0.5\n0,7,height,stuck,1\n"));
  const auto read = p.read(s);
  EXPECT_EQ((std::vector<float>(read.begin(), read.begin() + 8)),
            (std::vector<float>{3, 2.5, 8, 8, 0, 6, 3.5, 3}));
  const auto hit = s.readings(1);
  EXPECT_EQ((std::vector<float>(hit.begin(), hit.begin() + 5)), (std::vector<float>{1, 1, 0, 0, 1}));
}

// An entry that names the mask gives a value of the mask.
TEST(SensorErrorModel, FaultMapAffectsMaskAlone) {
  Plate p({});
  SensorArray s = p.sensors(
      fault_map("0,1,proximity_hit,stuck,0\n0,2,proximity_hit,stuck,1\n0,3,proximity_hit,stuck_low,\n"
                "0,4,proximity_hit,stuck_high,\n0,5,proximity_hit,dead,\n"));
  for (const float z : {p.snapshot.position[0][2], 1e6F}) {
    p.snapshot.position[0][2] = z;
    const auto read = p.read(s);
    const auto hit = s.readings(1);
    const float truth = z == 1e6F ? 0.0F : 1.0F;
    EXPECT_EQ((std::vector<float>(hit.begin(), hit.begin() + 6)), (std::vector<float>{truth, 0, 1, 0, 1, 0}));
    EXPECT_EQ(std::ranges::count(std::span(read).first(6), z == 1e6F ? 8.0F : 3.0F), 6);
  }
}

TEST(SensorErrorModel, RejectsInvalidFaultWithOneLine) {
  Plate p({});
  EXPECT_EQ(
      error_message_of([&] { p.sensors(fault_map("0,1,proximity,broken,1\n")); }),
      "faults.csv:2: fault 'broken': not a fault of a sensor; known: dead, stuck, stuck_low, stuck_high, "
      "gain, offset");
  EXPECT_EQ(error_message_of([&] { p.sensors(fault_map("0,1,proximity,stuck,\n")); }),
            "faults.csv:2: fault 'stuck': needs a value");
  EXPECT_EQ(error_message_of([&] { p.sensors(fault_map("0,1,proximity_hit,stuck,0.5\n")); }),
            "faults.csv:2: value of 'stuck' = 0.5: must be 0 or 1");
  EXPECT_EQ(error_message_of([&] { p.sensors(fault_map("0,1,proximity_hit,gain,2\n")); }),
            "faults.csv:2: fault 'gain': channel 'proximity_hit' has no gain");
}
