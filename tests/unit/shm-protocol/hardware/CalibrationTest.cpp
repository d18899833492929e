// Calibration: fits of secret pins against their secrets, the file, and its use in both directions.
#include "shm-protocol/hardware/bridge/Calibration.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/Calibrator.h"
#include "shm-protocol/hardware/fake/ImperfectPins.h"

namespace hardware {
namespace {

constexpr double kRange = 4, kPeriod_s = 0.01, kResolution = 0.001;

// What a calibration would record of these pins, with every twentieth frame lost.
struct Recording {
  Recording(ImperfectPins& pins, std::uint32_t seed, const std::vector<float>& plan) {
    std::mt19937 random(seed);
    const std::size_t cells = pins.cells().size();
    at_rest.resize(cells);
    readings.resize(cells);
    for (int k = 0; k < 100; ++k)
      for (std::size_t cell = 0; cell < cells; ++cell) at_rest[cell].push_back(read(pins, cell));
    std::vector<float> u(cells);
    const auto drive = [&](float value) {
      std::ranges::fill(u, value);
      pins.advance(u);
    };
    for (int k = 0; k < 100; ++k) drive(0.05F * kRange);
    for (int k = 0; k < 100; ++k) drive(plan[0] * static_cast<float>(kRange));
    for (const float fraction : plan) {
      command.push_back(fraction * static_cast<float>(kRange));
      drive(command.back());
      valid.push_back(random() % 20 != 0);
      for (std::size_t cell = 0; cell < cells; ++cell) readings[cell].push_back(read(pins, cell));
    }
  }
  static float read(ImperfectPins& pins, std::size_t cell) {
    return static_cast<float>(std::round(pins.read(cell) / kResolution) * kResolution);
  }
  CellFit fit(std::size_t cell) const {
    return fit_cell({kPeriod_s, command, readings[cell], valid, true, at_rest[cell], 0, kResolution});
  }
  std::vector<float> command;
  std::vector<std::uint8_t> valid;
  std::vector<std::vector<float>> readings, at_rest;
};

std::array<double, CellFit::kCount> secrets(const ImperfectPins::Cell& c) {
  return {c.zero,        c.slope, c.play, c.speed_up, c.speed_down, c.lag_s, static_cast<double>(c.delay),
          c.sensor_zero, c.noise};
}

// CALIBRATION_TEST_SEEDS=50 tries 50 tables.
TEST(Calibration, IntervalsHoldTheSecretsOfAllButOneInTwenty) {
  int held = 0, all = 0;
  const char* const seeds = std::getenv("CALIBRATION_TEST_SEEDS");
  for (std::uint32_t seed = 1; seed <= (seeds ? std::stoul(seeds) : 2); ++seed) {
    ImperfectPins pins(40, kRange, kPeriod_s, seed);
    const Recording recording(pins, seed, calibration_plan(20));
    for (std::size_t cell = 0; cell < pins.cells().size(); ++cell) {
      const ImperfectPins::Cell& secret = pins.cells()[cell];
      const CellFit fit = recording.fit(cell);
      ASSERT_EQ(static_cast<int>(fit.state), secret.state) << seed << " " << cell;
      if (secret.state != 0) continue;
      const auto truth = secrets(secret);
      EXPECT_EQ(fit.value[CellFit::kDelay], secret.delay) << seed << " " << cell;
      for (std::size_t p = 0; p < CellFit::kCount; ++p) {
        if (p == CellFit::kDelay) continue;
        ++all;
        held += std::abs(fit.value[p] - truth[p]) <= 1.96 * fit.error[p];
        EXPECT_LE(std::abs(fit.value[p] - truth[p]), 5 * fit.error[p])
            << kCellParameters[p].name << " " << cell;
        // An interval that holds everything says nothing.
        EXPECT_LE(fit.error[p],
                  p == CellFit::kLag || p == CellFit::kPlay ? 0.002 : 0.03 * std::abs(truth[p]) + 0.002)
            << kCellParameters[p].name << " " << cell;
      }
    }
  }
  EXPECT_GT(held, 0.92 * all) << "of " << all;
  EXPECT_LT(held, 0.98 * all) << "of " << all;
}

TEST(Calibration, ReadingsThatAreNoNumbersAreNotKnown) {
  ImperfectPins pins(1, kRange, kPeriod_s, 3);
  Recording recording(pins, 3, calibration_plan(20));
  const CellFit fit = recording.fit(0);
  ASSERT_EQ(fit.state, CellState::kGood);
  for (std::size_t k = 0; k < recording.valid.size(); ++k)
    if (!recording.valid[k]) recording.readings[0][k] = std::numeric_limits<float>::quiet_NaN();
  recording.at_rest[0].push_back(std::numeric_limits<float>::infinity());
  std::ranges::fill(recording.valid, 1);
  EXPECT_EQ(recording.fit(0).value, fit.value);
  EXPECT_EQ(recording.fit(0).error, fit.error);
  std::ranges::fill(recording.readings[0], std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(recording.fit(0).state, CellState::kDead);
}

TEST(Calibration, SpeedThatWasNeverReachedIsNotReported) {
  CellModel model;
  model.lag_s = 0.05;
  const auto plan = calibration_plan(20);
  CellMotion motion(model, kPeriod_s, static_cast<double>(plan[0]), true);
  std::mt19937 random(3);
  std::vector<float> readings;
  for (const float u : plan)
    readings.push_back(static_cast<float>(motion.advance(static_cast<double>(u)) +
                                          1e-3 * (static_cast<double>(random() % 1000) / 1000 - 0.5)));
  const std::vector<std::uint8_t> valid(plan.size(), 1);
  const CellFit fit = fit_cell({kPeriod_s, plan, readings, valid, true, {}, 0, 0});
  EXPECT_EQ(fit.value[CellFit::kSpeedUp], 0);
  EXPECT_EQ(fit.value[CellFit::kSpeedDown], 0);
  EXPECT_NEAR(fit.value[CellFit::kLag], 0.05, 0.001);
  EXPECT_EQ(fit.error[CellFit::kSensorZero], 0) << "not known without rest";
}

TEST(Calibration, CellsWithoutPlayHaveNone) {
  const auto plan = calibration_plan(20);
  const std::vector<std::uint8_t> valid(plan.size(), 1);
  std::mt19937 random(5);
  std::normal_distribution<> noise(0, 0.01);
  int found = 0;
  for (int cell = 0; cell < 40; ++cell) {
    CellModel model;
    model.lag_s = 0.03;
    CellMotion motion(model, kPeriod_s, static_cast<double>(plan[0]), true);
    std::vector<float> readings;
    for (const float u : plan)
      readings.push_back(static_cast<float>(motion.advance(static_cast<double>(u)) + noise(random)));
    const CellFit fit = fit_cell({kPeriod_s, plan, readings, valid, true, {}, 0, 0});
    found += fit.value[CellFit::kPlay] > 0;
    EXPECT_GT(fit.error[CellFit::kPlay], 0);
  }
  EXPECT_LE(found, 4) << "of 40";
}

// The law has no acceleration; cells have.
TEST(Calibration, IntervalsAreWiderWhereTheLawLeavesSomethingOut) {
  const auto plan = calibration_plan(20);
  const std::vector<std::uint8_t> valid(plan.size(), 1);
  std::mt19937 random(6);
  std::normal_distribution<> noise(0, 0.004);
  std::uniform_real_distribution<> uniform(-1, 1);
  constexpr int kCells = 40, kSteps = 8;
  int held = 0, with_play = 0;
  for (int cell = 0; cell < kCells; ++cell) {
    const double zero = 0.05 * uniform(random), slope = 1 + 0.05 * uniform(random), lag_s = 0.03;
    double p = zero + slope * static_cast<double>(plan[0]), v = 0;
    std::vector<float> readings;
    for (const float u : plan) {
      for (int k = 0; k < kSteps; ++k) {
        const double dt = kPeriod_s / kSteps, change = 60 * dt,
                     wanted = std::clamp((zero + slope * static_cast<double>(u) - p) / lag_s, -5.0, 5.0);
        v += std::clamp(wanted - v, -change, change);
        p += v * dt;
      }
      readings.push_back(static_cast<float>(p + noise(random)));
    }
    const CellFit fit = fit_cell({kPeriod_s, plan, readings, valid, true, {}, 0, 0});
    held += std::abs(fit.value[CellFit::kZero] - zero) <= 1.96 * fit.error[CellFit::kZero];
    held += std::abs(fit.value[CellFit::kSlope] - slope) <= 1.96 * fit.error[CellFit::kSlope];
    with_play += fit.value[CellFit::kPlay] > 0;
  }
  EXPECT_GE(held, 0.9 * 2 * kCells);
  EXPECT_LE(with_play, 0.1 * kCells);
}

TEST(Stillness, NoiseIsStillAndAnyMotionIsNot) {
  constexpr int kWindow = 20;
  std::mt19937 random(4);
  std::normal_distribution<> noise(0, 0.01);
  for (const double speed : {0.0, 0.002, 0.05}) {  // a period
    Stillness stillness;
    stillness.reset(100, kWindow);
    int windows = 0, still = 0;
    for (int period = 0; period < 30 * kWindow; ++period) {
      std::vector<float> readings;
      for (int cell = 0; cell < 100; ++cell)
        readings.push_back(static_cast<float>(noise(random) + (cell == 7 ? speed * period : 1)));
      const bool is_still = stillness.add(readings);
      EXPECT_TRUE(!is_still || (period + 1) % kWindow == 0);
      if (period < kWindow || (period + 1) % kWindow != 0) continue;
      ++windows;
      still += is_still;
    }
    if (speed == 0)
      EXPECT_EQ(still, windows);
    else
      EXPECT_EQ(still, 0) << speed;
  }
}

class CalibrationFile : public testing::Test {
 protected:
  CalibrationFile() {
    pins_.emplace(6, kRange, kPeriod_s, 11);
    calibration_.table = "t";
    calibration_.actuator = "height";
    calibration_.sensor = "pin_height";
    calibration_.unit = "u";
    calibration_.rows = 2;
    calibration_.columns = 3;
    calibration_.period_us = 10000;
    calibration_.boards = {{"a", 0, 0, 0, false, 0}};
    for (const ImperfectPins::Cell& c : pins_->cells()) {
      CellFit fit;
      fit.state = CellState::kGood;
      fit.value = secrets(c);
      fit.error.fill(0.25);
      calibration_.fits.push_back(fit);
    }
  }
  ~CalibrationFile() override { std::filesystem::remove(path_); }
  const std::string& write(const std::string& text) {
    std::ofstream(path_) << text;
    return path_;
  }
  std::string error(const std::string& text, const TableSpec* spec = nullptr,
                    const DeviceDescription* device = nullptr) {
    try {
      Calibration c = Calibration::read(write(text));
      if (spec) c.require_table(*spec);
      if (device) {
        TableMap map(*spec);
        map.mount(0, *device);
        map.freeze();
        c.require_map(map);
      }
    } catch (const std::invalid_argument& e) {
      const std::string line = e.what();
      EXPECT_EQ(line.find('\n'), line.npos) << line;
      EXPECT_TRUE(line.starts_with(path_ + ":")) << line;
      return line.substr(std::min(line.size(), path_.size() + 1));
    }
    return "none";
  }
  // A table of one board of 2 rows of 3 cells, and the board.
  static TableSpec table() {
    TableSpec spec;
    spec.file = "table.toml";
    spec.period_us = 10000;
    spec.boards.emplace_back();
    spec.boards[0].id = "a";
    spec.boards[0].line = 5;
    return spec;
  }
  static DeviceDescription device() {
    DeviceDescription device;
    device.id = "a";
    device.version = 2;
    device.rows = 2;
    device.columns = 3;
    device.period_us = 10000;
    device.pitch = 1;
    device.channels.push_back({"height", "u", false, SSW_F32, 1, 0, kRange, 0, 1, 0, 6, 0, {}, 0});
    device.channels.push_back({"pin_height", "u", true, SSW_F32, 1, 0, kRange, 0, 1, 0, 6, 0, {}, 0});
    return device;
  }
  static MountedBoard mounted(const DeviceDescription& device) {
    const TableSpec spec = table();
    TableMap map(spec);
    map.mount(0, device);
    map.freeze();
    return map.boards()[0];
  }
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return text.replace(at, from.size(), to);
  }

  std::string path_ = testing::TempDir() + "calibration-" + std::to_string(::getpid()) + ".toml";
  std::optional<ImperfectPins> pins_;
  Calibration calibration_;
};

TEST_F(CalibrationFile, IsReadAsWritten) {
  const Calibration read = Calibration::read(write(calibration_.text()));
  EXPECT_EQ(read.table, "t");
  ASSERT_EQ(read.fits.size(), 6u);
  for (std::size_t cell = 0; cell < 6; ++cell)
    for (std::size_t p = 0; p < CellFit::kCount; ++p) {
      EXPECT_EQ(read.fits[cell].value[p], calibration_.fits[cell].value[p]);
      EXPECT_EQ(read.fits[cell].error[p], 0.25);
    }
  EXPECT_EQ(read.text(), calibration_.text());
}

// Recordings that no law explains: commands that came in force late, sensors that say anything, few readings.
// The bridge must read what it has written.
TEST_F(CalibrationFile, WhatIsFittedToSpoiledRecordingsIsRead) {
  const TableSpec spec = table();
  const DeviceDescription device = CalibrationFile::device();
  std::mt19937 random(8);
  const auto uniform = [&random](double least, double most) {
    return std::uniform_real_distribution<>(least, most)(random);
  };
  int good = 0;
  for (int round = 0; round < 40; ++round) {
    auto plan = calibration_plan(8);
    for (float& u : plan) u *= static_cast<float>(kRange);
    for (CellFit& fit : calibration_.fits) {
      CellModel model;
      model.slope = uniform(0, 1) < 0.2 ? uniform(-0.2, 0.2) : uniform(0.5, 1.5);
      model.lag_s = uniform(0, 1) < 0.5 ? 0 : uniform(0, 0.05);
      if (uniform(0, 1) < 0.5) model.speed_up = model.speed_down = std::pow(10, uniform(0, 6));
      CellMotion motion(model, kPeriod_s, static_cast<double>(plan[0]), true);
      const double noise = std::pow(10, uniform(-9, 1)), offset = uniform(0, 1) < 0.2 ? uniform(-9, 9) : 0,
                   lost = uniform(0, 1) < 0.3 ? uniform(0, 1) : 0.05;
      const bool astray = uniform(0, 1) < 0.5;
      std::vector<float> readings;
      std::vector<std::uint8_t> valid;
      std::size_t behind = 0;
      for (std::size_t k = 0; k < plan.size(); ++k) {
        if (astray && random() % 40 == 0) behind = random() % 9;
        const double u = static_cast<double>(plan[k - std::min(k, behind)]);
        readings.push_back(static_cast<float>(offset + motion.advance(u) + uniform(-noise, noise)));
        valid.push_back(uniform(0, 1) >= lost);
      }
      const std::vector<float> at_rest(random() % 5, static_cast<float>(uniform(-9, 9)));
      fit = fit_cell({kPeriod_s, plan, readings, valid, true, at_rest, 0, kResolution});
      if (!is_usable(fit, kRange)) {  // for its place alone
        EXPECT_TRUE(std::abs(fit.value[CellFit::kZero]) > kRange ||
                    std::abs(fit.value[CellFit::kSensorZero]) > kRange ||
                    std::abs(fit.value[CellFit::kSlope]) < 0.1);
        fit = CellFit{};
      }
      good += fit.state == CellState::kGood;
    }
    EXPECT_EQ(error(calibration_.text(), &spec, &device), "none");
  }
  EXPECT_GT(good, 60) << "of 240";
}

// Units and names of channels come from devices.
TEST_F(CalibrationFile, TextsMayHoldAnyCharacter) {
  calibration_.unit = "\x01\"\\\n\x7f";
  EXPECT_EQ(Calibration::read(write(calibration_.text())).unit, calibration_.unit);
}

TEST_F(CalibrationFile, MistakesAreNamedWithTheirLine) {
  const std::string text = calibration_.text();
  EXPECT_EQ(error(replaced(text, "0.25", "nan")),
            "30: zero: error of row 0, column 0 is nan, must be a number from -1e+06 to 1e+06");
  EXPECT_EQ(error(replaced(text, "0.25, 0.25", "0.25, 1e300")),
            "30: zero: error of row 0, column 1 is 1e+300, must be a number from -1e+06 to 1e+06");
  EXPECT_EQ(error(replaced(text, "0.25, ", "")),
            "30: zero: error has a row of 2; 2 rows of 3 numbers are needed");
  EXPECT_EQ(error(replaced(text, "0.25", "\"much\"")).substr(0, 54),
            "30: zero: error of row 0, column 0 is not a number, mu");
  EXPECT_EQ(error(replaced(text, "0.25", "-0.25")), "30: zero: error -0.25 must not be negative");
  EXPECT_EQ(error(replaced(text, "size = [2, 3]", "size = [60000, 60000]")),
            "18: state: value must have 60000 rows");
  EXPECT_EQ(error(replaced(text, "[0, 0, 0]", "[0, 7, 0]")),
            "20: state: value of row 0, column 1 is 7.0, must be 0, 1, 2 or 3");
  EXPECT_EQ(error(replaced(text, "smartsurf calibration 1", "smartsurf calibration 9")).substr(0, 23),
            "3: format must be \"smar");
  EXPECT_EQ(error(text.substr(0, text.find("[lag]"))), "1: [lag] is missing: the file is not whole");
  EXPECT_EQ(error(replaced(text, "[lag]", "[leg]")).substr(0, 46),
            "74: unknown key 'leg'; known are format, table");
  EXPECT_EQ(error(replaced(text, "rest =", "colour = 1\nrest =")).substr(0, 31),
            "9: unknown key 'colour'; known ");
  EXPECT_EQ(error(replaced(text, "[state]", "[state]\nerror = 1")),
            "19: state: unknown key 'error'; known are value");
}

// Cut at any place, a file is refused in one line, or at the end whole.
TEST_F(CalibrationFile, CutIsRefused) {
  const std::string text = calibration_.text();
  for (std::size_t length = 0; length + 3 < text.size(); length += 13)
    EXPECT_NE(error(text.substr(0, length)), "none") << length;
}

TEST_F(CalibrationFile, OfAnotherTableIsRefused) {
  TableSpec spec = table();
  const TableBoard board = spec.boards[0];
  const std::string text = calibration_.text();
  EXPECT_EQ(error(text, &spec), "none");
  spec.boards[0].turn = 90;
  EXPECT_EQ(error(text, &spec),
            "12: is the calibration of another table: table.toml has no board 'a' at [0, 0], turn 0");
  spec.boards = {board, board};
  spec.boards[1].id = "b";
  EXPECT_EQ(error(text, &spec),
            "12: is the calibration of another table: it has no board 'b' at [0, 0], turn 0 (table.toml:5)");
  spec.boards = {board};
  spec.period_us = 5000;
  EXPECT_EQ(error(text, &spec),
            "8: is the calibration of another table: period_us is 10000, that of table.toml is 5000");
  spec.period_us = 10000;
  DeviceDescription device = CalibrationFile::device();
  device.channels.pop_back();
  device.channels[0].unit = "cm";
  EXPECT_EQ(error(text, &spec, &device), "6: the table has no sensor 'pin_height' of one component in 'u'");
  std::swap(device.rows, device.columns);
  EXPECT_EQ(error(text, &spec, &device),
            "10: is the calibration of another table: of 2 rows of 3 cells, not 3 of 2");
}

// Also after the board has gone to its safe values, from which the cells come back from below.
TEST_F(CalibrationFile, LeadsTheCellsWhereTheyAreSent) {
  Calibration c = Calibration::read(write(calibration_.text()));
  const MountedBoard board = mounted(device());
  ImperfectPins uncorrected(6, kRange, kPeriod_s, 11);
  std::vector<float> heights(6), commands(6), readings(6);
  double with = 0, without = 0;
  constexpr float kSafe = 0;
  for (const float target : {2.0F, 3.0F, 1.5F, kSafe, 1.5F, 1.0F, 2.5F}) {
    std::ranges::fill(heights, target);
    for (int k = 0; k < 200; ++k) {
      commands = heights;
      if (target == kSafe)
        c.note_own_command(board, kSafe);
      else
        c.correct_commands(board, commands);
      pins_->advance(commands);
      uncorrected.advance(heights);
    }
    for (std::size_t cell = 0; cell < 6; ++cell) readings[cell] = static_cast<float>(pins_->read(cell));
    c.correct_readings(board, readings);
    for (std::size_t cell = 0; cell < 6; ++cell) {
      if (pins_->cells()[cell].state != 0) continue;
      // Before its first change, a height has no direction.
      if (target == 2.0F || target == kSafe) continue;
      EXPECT_NEAR(readings[cell], target, 0.06F) << cell;
      with += std::abs(static_cast<double>(readings[cell] - target));
      without += std::abs(uncorrected.read(cell) - static_cast<double>(target));
    }
  }
  EXPECT_LT(with, without / 3);
}

TEST_F(CalibrationFile, LeavesCellsOfOtherBoardsAlone) {
  Calibration c = Calibration::read(write(calibration_.text()));
  DeviceDescription masked = device();
  masked.mask = {1, 0, 1, 1, 0, 1};
  const MountedBoard board = mounted(masked);
  std::vector<float> readings(6, 2.0F), commands(6, 2.0F);
  c.correct_readings(board, readings);
  c.correct_commands(board, commands);
  for (std::size_t cell = 0; cell < 6; ++cell) {
    EXPECT_EQ(readings[cell] == 2.0F, masked.mask[cell] == 0) << cell;
    EXPECT_EQ(commands[cell] == 2.0F, masked.mask[cell] == 0) << cell;
  }
}

// Nothing is fitted to holes, masked cells and boards that are not there.
TEST_F(CalibrationFile, SaysWhatIsAbsent) {
  TableSpec spec = table();
  spec.holes = true;
  spec.boards.push_back(spec.boards[0]);
  spec.boards[1].id = "b";
  spec.boards[1].column = 4;
  spec.boards[1].size = {2, 3};
  TableMap map(spec);
  map.mount(0, device());
  map.freeze();
  std::vector<std::unique_ptr<Board>> boards;
  for (const TableBoard& board : spec.boards)
    boards.push_back(std::make_unique<Board>(board, spec.period_us, std::chrono::seconds(1)));
  const std::vector<std::uint32_t> age(2, 1);
  std::vector<std::vector<float>> planes(2, std::vector<float>(14));
  Calibrator calibrator(spec, {});
  (void)calibrator.drive({1, map, boards, age, planes, false});
  EXPECT_EQ(calibrator.absent_boards(), (std::vector<std::string>{"board 'a'", "board 'b'"}));
  const Calibration fitted = calibrator.fit();
  EXPECT_EQ(fitted.cells(), 14U);
  EXPECT_EQ(fitted.present_cells(), 0U);
  EXPECT_TRUE(cells_to_adjust(fitted, 0, kRange).empty());
  EXPECT_EQ(Calibration::read(write(fitted.text())).present_cells(), 0U);
}

TEST_F(CalibrationFile, NamesTheCellsToAdjust) {
  for (CellFit& fit : calibration_.fits) fit.value = {0, 1, 0.01, 10, 10, 0.02, 0, 0, 0.004};
  EXPECT_TRUE(cells_to_adjust(calibration_, 0, kRange).empty());
  calibration_.fits[0].state = CellState::kStuck;
  calibration_.fits[2].value[CellFit::kSlope] = 0.8;
  calibration_.fits[4].value[CellFit::kSpeedUp] = 4;
  calibration_.fits[5].state = CellState::kAbsent;
  EXPECT_EQ(calibration_.present_cells(), 5U);
  EXPECT_EQ(cells_to_adjust(calibration_, 0, kRange),
            (std::vector<std::string>{"row 0 column 0: stuck", "row 0 column 2: reaches 3.2 u of 4.0",
                                      "row 1 column 1: slow upwards"}));
}

}  // namespace
}  // namespace hardware
