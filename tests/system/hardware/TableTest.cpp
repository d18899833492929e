// surface_bridge --table with emulated boards: one surface, faults that cost one board's cells only,
// emergency stop, a storm.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "shm-protocol/hardware/bridge/Calibration.h"
#include "tests/system/hardware/GivenUp.h"
#include "tests/system/hardware/Program.h"
#include "tests/system/hardware/Published.h"
#include "tests/system/hardware/SteppedDevice.h"

namespace hardware {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using shm_protocol::ControllerEndpoint;
using shm_protocol::Direction;
using shm_protocol::Status;

// FrameInfo::status, as docs/hardware.md has it.
constexpr std::uint32_t kMissed = 1, kStopped = 16, kBoardNotValid = 128;

// An emulator of several boards of 4×4 cells, its table and the bridge.
struct Table {
  explicit Table(const std::string& what, const std::string& boards, std::vector<std::string> flags = {},
                 std::vector<std::string> bridge_flags = {})
      : name(surface_name("table-" + what)),
        file(line_path(name) + ".toml"),
        device(emulator(boards, flags)) {
    std::vector<std::string> words{SURFACE_BRIDGE, "--table", file, "--shm", name};
    words.insert(words.end(), bridge_flags.begin(), bridge_flags.end());
    bridge.emplace(words);
  }
  ~Table() {
    bridge.reset();  // killed, it leaves its segments
    for (const char* suffix : {"", ".boards"}) ::unlink(segment_path(name + suffix).c_str());
    std::filesystem::remove(file);
  }
  std::vector<std::string> emulator(const std::string& boards, std::vector<std::string> flags) const {
    for (const char* word : {"--tcp", "0", "--size", "4x4", "--period-ms", "20", "--boards"})
      flags.push_back(word);
    flags.push_back(boards);
    flags.push_back("--table");
    flags.push_back(file);
    return flags;
  }
  std::string ask(const std::string& command) const {
    Program program({SURFACE_BRIDGE, command, name});
    EXPECT_EQ(program.wait(), 0) << program.output();
    return program.output();
  }

  std::string name, file;
  Device device;
  std::optional<Program> bridge;
};

// Commands a height to each cell that depends on cell and tick, and checks what the boards had in force.
class Checker {
 public:
  explicit Checker(const std::string& name)
      : controller(ControllerEndpoint::attach(name, {.timeout = 60s})),
        echo(controller.description().channel(Direction::kSensor, "target_echo")),
        valid(controller.description().channel(Direction::kSensor, "valid")),
        age(controller.description().channel(Direction::kSensor, "age")),
        height(controller.description().channel(Direction::kActuator, "height")),
        columns(controller.description().columns),
        cells(controller.description().cells()) {}

  static std::uint32_t commanded(std::uint64_t phase, std::size_t cell) {
    return static_cast<std::uint32_t>((phase + cell * 7) % 200 + 1);
  }

  void tick() {
    ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
    const auto raw = controller.sensor<std::uint8_t>(echo), ok = controller.sensor<std::uint8_t>(valid),
               ages = controller.sensor<std::uint8_t>(age);
    if (frames++ != 0) {
      EXPECT_GT(controller.sensor_info().tick, last_tick);
    }
    last_tick = controller.sensor_info().tick;
    valid_cells = safe_cells = 0;
    for (std::size_t cell = 0; cell < cells; ++cell) {
      EXPECT_EQ(ok[cell] != 0, ages[cell] == 0);
      valid_cells += ok[cell];
      safe_cells += ok[cell] != 0 && raw[cell] == 0;
      // A board has safe values in force, or one whole frame of ours.
      const std::size_t corner = cell / columns / 4 * 4 * columns + cell % columns / 4 * 4;
      if (raw[corner] == 0) {
        ASSERT_EQ(raw[cell], 0) << cell;
      } else {
        ASSERT_EQ((raw[cell] + 400 - raw[corner]) % 200, (cell - corner) * 7 % 200) << cell;
      }
    }
    const auto to = controller.actuator(height);
    for (std::size_t cell = 0; cell < cells; ++cell)
      to[cell] = static_cast<float>(commanded(last_tick, cell)) * 0.02F;
    ASSERT_TRUE(published(controller));
  }
  template <class Condition>
  void tick_until(Condition condition, Clock::duration most = 30s) {
    const auto until = Clock::now() + most;
    do ASSERT_NO_FATAL_FAILURE(tick());
    while (!condition() && Clock::now() < until);
    EXPECT_TRUE(condition()) << valid_cells << " valid, " << safe_cells << " safe";
  }
  bool all_move() const { return valid_cells == cells && safe_cells == 0; }
  bool board_valid(std::uint32_t row, std::uint32_t column) const {
    return controller.sensor<std::uint8_t>(valid)[4 * row * columns + 4 * column] != 0;
  }

  ControllerEndpoint controller;
  int echo, valid, age, height;
  std::uint32_t columns;
  std::size_t cells, valid_cells = 0, safe_cells = 0;
  std::uint64_t frames = 0, last_tick = 0;
};

class Versions : public testing::TestWithParam<const char*> {};

TEST_P(Versions, ManyBoardsAreOneSurface) {
  std::vector<std::string> flags{"--drift-ppm", "200"};
  if (std::string(GetParam()) == "One") flags.push_back("--version-1");
  Table table(std::string("one") + GetParam(), "3x2", flags);
  Checker checker(table.name);
  EXPECT_EQ(checker.controller.description().rows, 8u);
  EXPECT_EQ(checker.controller.description().columns, 12u);
  checker.tick_until([&] { return checker.all_move(); });
  const std::string status = table.ask("status");
  EXPECT_NE(status.find(" live "), std::string::npos) << status;
  std::size_t whole = 0;
  checker.tick_until([&] { return (whole += checker.all_move()) > 60; });
  table.bridge->signal(SIGINT);
  EXPECT_EQ(table.bridge->wait(), 130) << table.bridge->output();
  EXPECT_FALSE(segment_exists(table.name));
  EXPECT_FALSE(segment_exists(table.name + ".boards"));
}
INSTANTIATE_TEST_SUITE_P(Table, Versions, testing::Values("One", "Two"),
                         [](const auto& version) { return std::string(version.param); });

TEST(Table, IsAwaited) {
  const std::string name = surface_name("table-awaited"), file = line_path(name) + ".toml";
  Program bridge({SURFACE_BRIDGE, "--table", file, "--shm", name, "--ticks", "20"});
  std::this_thread::sleep_for(200ms);
  Device device(
      {"--tcp", "0", "--boards", "2x1", "--size", "4x4", "--period-ms", "20", "--table", file, "--once"});
  EXPECT_EQ(bridge.wait(), 0) << bridge.output();
  std::filesystem::remove(file);
}

TEST(Table, WaitForItEndsWithASignal) {
  const std::string none = line_path("none") + ".toml", out = line_path("out") + ".toml";
  for (const int number : {SIGINT, SIGTERM})
    for (const std::vector<std::string>& words : {std::vector<std::string>{SURFACE_BRIDGE, "--table", none},
                                                  {SURFACE_BRIDGE, "calibrate", none, "-o", out}}) {
      Program bridge(words);
      bridge.await_output("waiting for it");
      bridge.signal(number);
      EXPECT_EQ(bridge.wait(), 128 + number);
      EXPECT_EQ(bridge.output().find("error"), std::string::npos) << bridge.output();
    }
}

TEST(Table, StatusOfALongDeviceIsWhole) {
  const std::string name = surface_name("table-long"), file = line_path(name) + ".toml";
  Device device({"--pty", line_path(name) + std::string(180, 'x'), "--size", "4x4", "--period-ms", "20"});
  std::ofstream(file) << "name = 'long'\nperiod_us = 20000\n[[board]]\ndevice = '" << device.name
                      << "'\nat = [0, 0]\n";
  Program bridge({SURFACE_BRIDGE, "--table", file, "--shm", name});
  const auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  Program asked({SURFACE_BRIDGE, "status", name});
  EXPECT_EQ(asked.wait(), 0);
  EXPECT_NE(asked.output().find(" limited 0\n"), std::string::npos) << asked.output();
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 128 + SIGTERM);
  std::filesystem::remove(file);
}

TEST(Table, UnpluggedBoardCostsItsOwnCellsAndComesBack) {
  Table table("unplug", "2x2", {"--unplug-for", "60", "--restart"});
  Checker checker(table.name);
  checker.tick_until([&] { return checker.all_move(); });
  double share = 0;
  for (std::size_t cuts = 1; cuts <= 5 && share <= 0.75; ++cuts) {  // on a busy machine, frames are late
    table.device.program.signal(SIGUSR2);
    checker.tick_until([&] { return table.bridge->count_output("the line is cut") >= cuts; });
    checker.tick_until([&] {
      return checker.controller.sensor_info().status & kBoardNotValid && !checker.board_valid(0, 0);
    });
    int others = 0, ticks = 0;
    const auto cut_at = checker.last_tick;
    checker.tick_until([&] {
      ++ticks;
      others += checker.board_valid(0, 1) + checker.board_valid(1, 0) + checker.board_valid(1, 1);
      return checker.board_valid(0, 0);
    });
    EXPECT_GT(checker.last_tick - cut_at, 20u);
    share = others / 3.0 / ticks;
    checker.tick_until([&] { return checker.all_move(); });
  }
  EXPECT_GT(share, 0.75) << "of the other boards' frames";
}

TEST(Table, TicksThatASlowControllerSkipsCountForValidity) {
  Table table("slow", "2x1", {"--unplug-for", "100"});
  Checker checker(table.name);
  checker.tick_until([&] { return checker.all_move(); });
  const auto answer_each_fifth_tick = [&] {
    for (const auto until = Clock::now() + 1500ms; Clock::now() < until; std::this_thread::sleep_for(100ms))
      ASSERT_NO_FATAL_FAILURE(checker.tick());
  };
  answer_each_fifth_tick();
  table.device.program.signal(SIGUSR2);
  table.bridge->await_output("the line is cut");
  answer_each_fifth_tick();
  table.bridge->signal(SIGINT);
  EXPECT_EQ(table.bridge->wait(), 130);
  EXPECT_LT(std::stod(table.bridge->await_output("least_valid ")), 0.9) << table.bridge->output();
}

// The board's tick that the controller has seen, however many the bridge has read since.
TEST(Table, LateAnswerNamesTheTickThatItAnswers) {
  const std::string name = surface_name("table-late"), file = line_path(name) + ".toml";
  SteppedDevice device({{"tick", ""}}, {"height"});
  std::ofstream(file) << "name = 't'\nperiod_us = " << SteppedDevice::kPeriod_us << "\n[[board]]\ndevice = '"
                      << device.port() << "'\nat = [0, 0]\n";
  Program bridge({SURFACE_BRIDGE, "--table", file, "--shm", name, "--silence", "1000"});
  device.connect();
  auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  const int sensor = controller.description().channel(Direction::kSensor, "tick");
  const int valid = controller.description().channel(Direction::kSensor, "valid");
  device.await(SSW_START, 0);
  for (std::uint32_t tick = 1; tick < 20; tick += 4) {
    device.send_frame(tick);
    for (;;) {
      ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      if (controller.sensor<std::uint8_t>(valid)[0] != 0 &&
          controller.sensor<std::uint8_t>(sensor)[0] == tick)
        break;
      ASSERT_TRUE(published(controller));
    }
    for (std::uint32_t later = tick + 1; later < tick + 4; ++later) {
      device.send_frame(later);
      device.await(SSW_HEARTBEAT, later);
    }
    ASSERT_TRUE(published(controller));
    std::uint32_t answered;  // earlier ones answer frames without a reading
    do answered = device.await(SSW_ACTUATOR_END);
    while (answered < tick);
    EXPECT_EQ(answered, tick);
  }
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130) << bridge.output();
  std::filesystem::remove(file);
}

TEST(Table, AnswersOfASlowPassiveControllerAreLate) {
  Table table("late-passive", "1x1", {}, {"--mode", "passive"});
  auto controller = ControllerEndpoint::attach(table.name, {.timeout = 60s});
  auto observer = shm_protocol::ObserverEndpoint::attach(table.name, {.timeout = 60s});
  for (int answers = 0; answers < 30; ++answers) {
    ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
    const auto seen = controller.sensor_info().tick;
    do {
      ASSERT_EQ(observer.await(Direction::kSensor, {.timeout = 60s}), Status::kOk);
      const auto& info = observer.info(Direction::kSensor);
      EXPECT_TRUE(answers < 5 || info.status & (kMissed | kBoardNotValid)) << info.tick;
    } while (observer.info(Direction::kSensor).tick < seen + 2);
    ASSERT_TRUE(published(controller));
  }
  table.bridge->signal(SIGINT);
  EXPECT_EQ(table.bridge->wait(), 130) << table.bridge->output();
}

TEST(Table, EmergencyStopHoldsAllBoardsUntilItIsReleased) {
  Table table("stop", "2x2");
  Checker checker(table.name);
  checker.tick_until([&] { return checker.all_move(); });
  EXPECT_EQ(table.ask("stop"), "stopped\n");
  checker.tick_until([&] { return checker.safe_cells == checker.cells; });
  for (int i = 0; i < 30; ++i) {
    checker.tick();
    EXPECT_EQ(checker.safe_cells, checker.valid_cells) << "the stop latches";
    EXPECT_TRUE(checker.controller.sensor_info().status & kStopped);
  }
  EXPECT_NE(table.ask("status").find("emergency_stop by the user"), std::string::npos);
  EXPECT_EQ(table.ask("arm"), "armed\n");
  checker.tick_until([&] { return checker.all_move(); });
  EXPECT_FALSE(checker.controller.sensor_info().status & kStopped);
}

TEST(Table, ReleaseThatIsGivenUpIsNotDoneLater) {
  Table table("given-up", "1x1");
  table.bridge->await_output("controllers attach");
  check_commands_that_are_given_up(*table.bridge, table.name);
}

TEST(Table, AnswersThatAStopReplacesAreNotSent) {
  Table table("stopped", "2x1");
  table.bridge->await_output("controllers attach");
  EXPECT_EQ(table.ask("stop"), "stopped\n");
  Checker checker(table.name);
  for (int i = 0; i < 20; ++i) checker.tick();
  table.bridge->signal(SIGINT);
  EXPECT_EQ(table.bridge->wait(), 130);
  EXPECT_EQ(table.bridge->figure("answers"), 0u) << table.bridge->output();
}

TEST(Table, LineOfOneBoardStopsAll) {
  Table table("line", "2x1", {"--stop-at", "150"});
  Checker checker(table.name);
  checker.tick_until([&] { return (checker.controller.sensor_info().status & kStopped) != 0; });
  checker.tick_until([&] { return checker.safe_cells == checker.cells; });
  EXPECT_NE(table.ask("status").find("emergency_stop by board 'b0'"), std::string::npos);
  table.ask("arm");
  checker.tick_until([&] { return checker.all_move(); });
}

// Boards are unplugged, restarted, silenced and disturbed at random; frames stay whole, ticks go on, and each
// board comes back. scripts/check-boards lets it last ten minutes.
TEST(Table, StormCostsCellsOnly) {
  Table table("storm", "4x2", {"--storm", "4", "--seed", "3", "--delay-ms", "2", "--drift-ppm", "100"},
              {"--silence", "0.2"});
  Checker checker(table.name);
  checker.tick_until([&] { return checker.all_move(); });
  const auto enough = Clock::now() + 6s;
  std::vector<int> seen(8, 0);
  checker.tick_until(
      [&] {
        for (std::uint32_t board = 0; board < 8; ++board)
          seen[board] += checker.board_valid(board / 4, board % 4);
        return Clock::now() > enough && std::ranges::min(seen) > 20;
      },
      60s);
  table.bridge->signal(SIGINT);
  EXPECT_EQ(table.bridge->wait(), 130) << table.bridge->output();
}

// Cells with secret errors are calibrated; with the calibration, they go where they are sent.
TEST(Table, CalibrationLeadsTheCellsWhereTheyAreSent) {
  const std::string name = surface_name("table-calibrated"), base = line_path(name), file = base + ".toml",
                    calibration = base + "-calibration.toml";
  Device device({"--tcp", "0", "--size", "4x4", "--boards", "2x1", "--period-ms", "10", "--errors", "5",
                 "--table", file});
  std::string said;
  int status = 1;
  // A host that is busy for too long is told to calibrate again; the pins are then no longer at rest.
  for (int attempt = 0; attempt < 4 && status == 1; ++attempt) {
    std::vector<std::string> words{SURFACE_BRIDGE, "calibrate", file,    "-o", calibration,
                                   "--hold",       "0.2",       "--shm", name};
    if (attempt == 0) words.insert(words.end(), {"--rest", "0"});
    Program calibrate(words);
    status = calibrate.wait();
    said = calibrate.output();
  }
  ASSERT_EQ(status, 0) << said;
  EXPECT_NE(said.find("32 cells, "), std::string::npos) << said;
  EXPECT_TRUE(std::filesystem::exists(base + "-calibration.svg"));
  const auto error = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> words{SURFACE_BRIDGE, "--table", file, "--shm", name};
    words.insert(words.end(), flags.begin(), flags.end());
    Program bridge(words);
    ControllerEndpoint controller = ControllerEndpoint::attach(name, {.timeout = 60s});
    Program asked({SURFACE_BRIDGE, "status", name});
    EXPECT_EQ(asked.wait(), 0);
    EXPECT_EQ(asked.output().find("\ncalibration " + calibration + "\n") != std::string::npos,
              !flags.empty());
    const int pin = controller.description().channel(Direction::kSensor, "pin_height");
    const int height = controller.description().channel(Direction::kActuator, "height");
    // The least median: a busy host lets the watchdog lower the pins, and some are stuck or dead.
    float least = 9;
    for (int tick = 0; tick < 400 && (tick < 160 || least > 0.03F); ++tick) {
      EXPECT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      const float target = tick < 80 ? 1.0F : 2.5F;
      std::vector<float> errors;
      for (const float p : controller.sensor<float>(pin)) errors.push_back(std::abs(p - target));
      std::ranges::nth_element(errors, errors.begin() + 16);
      if (tick > 120) least = std::min(least, errors[16]);
      std::ranges::fill(controller.actuator(height), target);
      (void)controller.publish();
    }
    bridge.signal(SIGINT);
    EXPECT_EQ(bridge.wait(), 130) << bridge.output();
    return least;
  };
  const float with = error({"--calibration", calibration}), without = error({});
  EXPECT_LT(with, 0.03F);
  EXPECT_GT(without, 0.06F);

  std::string text;
  std::ifstream in(calibration);
  text.assign(std::istreambuf_iterator<char>(in), {});
  std::ofstream(calibration) << text.substr(0, text.size() / 2);
  Program cut({SURFACE_BRIDGE, "--table", file, "--shm", name, "--calibration", calibration});
  EXPECT_EQ(cut.wait(), 2);
  EXPECT_NE(cut.output().find("-calibration.toml:"), std::string::npos) << cut.output();
  for (const std::string& made : {file, calibration, base + "-calibration.svg"})
    std::filesystem::remove(made);
}

TEST(Table, ClientsThatAskNothingDoNotKeepAnEmergencyStopOut) {
  Table table("stuck", "1x1");
  ControllerEndpoint controller = ControllerEndpoint::attach(table.name, {.timeout = 60s});
  sockaddr_un at{};
  at.sun_family = AF_UNIX;
  const std::string name = "smartsurf." + std::to_string(::geteuid()) + "." + table.name;
  name.copy(at.sun_path + 1, sizeof at.sun_path - 1);
  const auto bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  std::vector<int> stuck;
  for (int k = 0; k < 40; ++k) {
    stuck.push_back(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::connect(stuck.back(), reinterpret_cast<const sockaddr*>(&at), bytes), 0) << k;
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(table.ask("stop"), "stopped\n");
  EXPECT_NE(table.ask("status").find("emergency_stop by the user"), std::string::npos);
  for (const int client : stuck) ::close(client);
}

// Boards that wait for late answers miss hardly any, however slow the controller is.
TEST(Table, PatientBoardsWaitForLateAnswers) {
  const auto missed = [](const std::vector<std::string>& flags) {
    Table table("patient", "2x1", flags, {"--silence", "60"});
    ControllerEndpoint controller = ControllerEndpoint::attach(table.name, {.timeout = 60s});
    const int height = controller.description().channel(Direction::kActuator, "height");
    bool came_back = false;
    // Until the clocks of boards that were gone agree again takes up to a hundred ticks.
    for (int tick = 0; tick < 60 || (!came_back && tick < 300); ++tick) {
      EXPECT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
      const auto valid =
          controller.sensor<std::uint8_t>(controller.description().channel(Direction::kSensor, "valid"));
      came_back = came_back || (tick > 30 && std::ranges::count(valid, 1) == std::ssize(valid));
      std::ranges::fill(controller.actuator(height), 1.0F);
      if (tick > 10 && tick % 5 == 0) std::this_thread::sleep_for(90ms);  // of a period of 20 ms
      if (tick == 22) std::this_thread::sleep_for(600ms);  // the host takes the boards for gone
      (void)controller.publish();
    }
    EXPECT_TRUE(came_back) << testing::PrintToString(flags);
    table.bridge->signal(SIGINT);
    table.bridge->wait();
    const std::string said = table.bridge->output();
    const std::size_t at = said.find("board_missed ");
    EXPECT_NE(at, std::string::npos) << said;
    return std::stoi(said.substr(at + 13));
  };
  // While the session begins, an answer may be late; on a busy machine, more are.
  int least = missed({"--patient"});
  for (int attempt = 1; attempt < 5 && least > 12; ++attempt) least = std::min(least, missed({"--patient"}));
  EXPECT_LE(least, 12);
  EXPECT_GE(missed({}), 30);
}

// A board that has begun its next period does not hold those whose clocks are a little later: the frames of
// all come in time for each tick.
TEST(Table, PatientBoardsKeepInStep) {
  double share = 0;
  for (int attempt = 0; attempt < 10 && share < 0.75; ++attempt) {  // on a busy machine, frames are late
    Table table("in-step", "2x2", {"--patient", "--drift-ppm", "100"}, {"--silence", "60"});
    Checker checker(table.name);
    int whole = 0;
    for (int tick = 0; tick < 120; ++tick) {
      checker.tick();
      if (tick >= 40) whole += checker.valid_cells == checker.cells;
    }
    share = whole / 80.0;
  }
  EXPECT_GE(share, 0.75);
}

// Counts the 95 % intervals of zero, slope, speeds and lag of the good cells that hold what --truth wrote.
struct Intervals {
  int held = 0, all = 0, wrong_states = 0;
};
Intervals intervals_of(const Calibration& fitted, const std::string& truth) {
  constexpr std::array<std::pair<CellFit::Parameter, int>, 5> kColumns{{{CellFit::kZero, 2},
                                                                        {CellFit::kSlope, 3},
                                                                        {CellFit::kSpeedUp, 5},
                                                                        {CellFit::kSpeedDown, 6},
                                                                        {CellFit::kLag, 7}}};
  Intervals found;
  std::ifstream in(truth);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::vector<double> values;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) values.push_back(std::stod(field));
    const CellFit& fit =
        fitted
            .fits[static_cast<std::size_t>(values[0]) * fitted.columns + static_cast<std::size_t>(values[1])];
    found.wrong_states += static_cast<int>(fit.state) != static_cast<int>(values[11]);
    if (values[11] != 0 || fit.state != CellState::kGood) continue;
    for (const auto& [parameter, column] : kColumns) {
      if (fit.error[parameter] == 0) continue;
      ++found.all;
      found.held += std::abs(fit.value[parameter] - values[static_cast<std::size_t>(column)]) <=
                    1.96 * fit.error[parameter];
    }
  }
  return found;
}

TEST(Table, CalibrationRepeatsWhatASuspensionOfTheHostSpoils) {
  const std::string name = surface_name("table-suspended"), base = line_path(name), file = base + ".toml",
                    calibration = base + "-calibration.toml", truth = base + "-truth.csv";
  std::string said;
  int status = 1;
  for (int attempt = 0; attempt < 3 && status == 1; ++attempt) {  // a host may be too busy for it
    Device device({"--tcp", "0", "--size", "4x4", "--boards", "2x1", "--period-ms", "5", "--errors", "9",
                   "--truth", truth, "--table", file});
    Program calibrate({SURFACE_BRIDGE, "calibrate", file, "-o", calibration, "--rest", "0", "--hold", "0.1",
                       "--shm", name});
    calibrate.await_output("controllers attach");
    std::this_thread::sleep_for(2s);  // at rest, and until the plan begins
    for (const auto length : {50ms, 100ms, 300ms, 1000ms}) {
      std::this_thread::sleep_for(700ms);
      calibrate.signal(SIGSTOP);
      std::this_thread::sleep_for(length);
      calibrate.signal(SIGCONT);
    }
    status = calibrate.wait();
    said = calibrate.output();
  }
  ASSERT_EQ(status, 0) << said;
  EXPECT_NE(said.find(" parts were repeated, the last one because "), std::string::npos) << said;
  const Intervals found = intervals_of(Calibration::read(calibration), truth);
  EXPECT_EQ(found.wrong_states, 0);
  EXPECT_GE(found.all, 100);
  EXPECT_GE(found.held, 0.85 * found.all) << "of " << found.all;
  for (const std::string& made : {file, calibration, truth, base + "-calibration.svg"})
    std::filesystem::remove(made);
}

TEST(Table, BadTableIsOneLine) {
  Table table("bad", "2x1");
  std::ifstream in(table.file);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  const std::string file = table.file + ".bad";
  const auto expect = [&](const std::string& from, const std::string& to, const std::string& message) {
    std::string changed = text;
    const std::size_t at = changed.rfind(from);
    ASSERT_NE(at, std::string::npos);
    std::ofstream(file) << changed.replace(at, from.size(), to);
    Program bridge({SURFACE_BRIDGE, "--table", file, "--shm", table.name + "-bad"});
    EXPECT_EQ(bridge.wait(), 2);
    const std::string said = bridge.output();
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    EXPECT_NE(said.find(message), std::string::npos) << said;
  };
  table.bridge.reset();  // a device serves one host
  expect("at = [0, 4]", "at = [0, 3]",
         ".bad:10: board 'b1': overlaps board 'b0' of line 5 at row 0, column 3");
  expect("at = [0, 4]", "at = [0, 5]", ".bad:10: board 'b1': no board covers row 0, column 4");
  expect("id = \"b1\"", "id = \"b9\"", ":10: board 'b9': the device is board 'b1'");
  expect("period_us = 20000", "period_us = 10000", "control period is 20000 µs");
  expect("at = [0, 4]", "at = [0, 4]\nturn = 10", ":14: board 'b1': turn is 10");
  expect("at = [0, 4]", "at = [0, 4]\nwithout = [\"load\"]", ":10: board 'b1': without names 'load'");
  expect("at = [0, 4]", "at = [0, 70000]",
         ":13: board 'b1': at must be [row, column], whole numbers from 0 to 65535");
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace hardware
