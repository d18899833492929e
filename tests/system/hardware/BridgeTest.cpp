// surface_bridge and an emulated device: good lines, bad lines, silence, unplugging, ends.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>
#include <utility>

#include "shm-protocol/hardware/bridge/TableFile.h"
#include "shm-protocol/hardware/fake/toy.h"
#include "tests/system/hardware/GivenUp.h"
#include "tests/system/hardware/Program.h"
#include "tests/system/hardware/Published.h"
#include "tests/system/hardware/SteppedDevice.h"

namespace hardware {
namespace {

using namespace std::chrono_literals;
using shm_protocol::ControllerEndpoint;
using shm_protocol::Direction;
using shm_protocol::Status;

constexpr std::uint32_t kRows = 12, kColumns = 20, kCells = kRows * kColumns;
constexpr const char* kSize = "20x12";
// FrameInfo::status, as docs/hardware.md has it.
constexpr std::uint32_t kMissed = 1, kLost = 2, kAfterSilence = 8;

std::uint32_t commanded(std::uint64_t tick, std::uint32_t cell) {
  return static_cast<std::uint32_t>((tick * 5 + cell * 3) % 200 + 1);
}

// A controller that checks all it sees. The device's ticks run ahead of the session's by a number that it
// learns.
class Checker {
 public:
  explicit Checker(const std::string& name)
      : controller(ControllerEndpoint::attach(name, {.timeout = 60s})),
        hit(controller.description().channel(Direction::kSensor, "proximity_hit")),
        echo(controller.description().channel(Direction::kSensor, "target_echo")),
        height(controller.description().channel(Direction::kActuator, "height")) {
    forget_offset();
  }

  void forget_offset() {
    for (std::uint64_t offset = 0; offset < 3000; ++offset) offsets.insert(offset);
  }

  // Waits for a frame, checks it and answers it.
  void tick() {
    ASSERT_EQ(controller.await_sensors({.timeout = 100s}), Status::kOk);
    look();
    answer();
  }

  void look() {
    const auto& info = controller.sensor_info();
    if (frames != 0) {
      EXPECT_GT(info.tick, last_tick);
      // Ticks are left out by the line, which the frame says, or (passive) by us, which we count.
      const auto skipped_before = std::exchange(skipped, controller.counters().skipped);
      if (info.tick != last_tick + 1) {
        EXPECT_TRUE((info.status & kLost) || skipped != skipped_before);
      }
    }
    last_tick = info.tick;
    ++frames;
    const auto hits = controller.sensor<std::uint8_t>(hit);
    std::erase_if(offsets, [&](std::uint64_t offset) {
      for (std::uint32_t c = 0; c < kCells; ++c)
        if (hits[c] != toy_hit(kRows, kColumns, info.tick + offset, c / kColumns, c % kColumns)) return true;
      return false;
    });
    EXPECT_FALSE(offsets.empty()) << "frame " << info.tick << " shows what no tick shows";
    check_echo();
  }

  // The values in force on the device are the safe ones, or one whole frame of ours.
  void check_echo() {
    const auto raw = controller.sensor<std::uint8_t>(echo);
    safe = std::ranges::all_of(raw, [](std::uint8_t r) { return r == 0; });
    if (safe) return;
    ++echoed;
    const std::uint32_t phase = raw[0] - 1u;
    for (std::uint32_t c = 0; c < kCells; ++c) ASSERT_EQ(raw[c], (phase + c * 3) % 200 + 1);
  }

  void answer() {
    const auto to = controller.actuator(height);
    for (std::uint32_t c = 0; c < kCells; ++c) to[c] = static_cast<float>(commanded(last_tick, c)) * 0.02F;
    ASSERT_TRUE(published(controller));
  }

  ControllerEndpoint controller;
  int hit, echo, height;
  std::set<std::uint64_t> offsets;
  std::uint64_t last_tick = 0, frames = 0, echoed = 0, skipped = 0;
  bool safe = false;
};

TEST(Bridge, GoodLineDeliversEveryFrame) {
  const std::string name = surface_name("bridge-good");
  Device device({"--pty", line_path("good"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--ticks", "2000"});
  {
    Checker checker(name);
    EXPECT_EQ(checker.controller.description().period_ns, 5'000'000u);
    while (checker.controller.surface_state() != shm_protocol::State::kClosing && checker.frames < 150)
      checker.tick();
    EXPECT_GT(checker.echoed, 20u);
  }
  EXPECT_EQ(bridge.wait(), 0) << bridge.output();  // goes on without a controller
  EXPECT_EQ(bridge.figure("frames"), 2000u);
  EXPECT_EQ(bridge.figure("damaged_packets"), 0u);
  EXPECT_FALSE(segment_exists(name));
}

class BadLine : public testing::TestWithParam<std::string> {};

TEST_P(BadLine, DeliveredFramesAreCorrectAndMissesCounted) {
  const bool passive = GetParam() == "passive";
  const std::string name = surface_name("bridge-bad-" + GetParam());
  Device device({"--tcp", "0", "--size", kSize, "--period-ms", "5", "--drop", "0.0002", "--corrupt", "0.0002",
                 "--delay-ms", "8", "--seed", "7"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--mode", GetParam()});
  {
    Checker checker(name);
    std::uint32_t seen = 0;
    while (checker.frames < 300) {
      checker.tick();
      seen |= checker.controller.sensor_info().status;
    }
    EXPECT_GT(checker.echoed, 20u);
    EXPECT_TRUE(seen & kMissed);
    EXPECT_TRUE(seen & kLost);
    EXPECT_GT(checker.controller.surface_counters().deadline_misses, 0u);
    if (passive) {
      EXPECT_EQ(checker.controller.description().mode, shm_protocol::Mode::kPassive);
    }
  }
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130) << bridge.output();
  EXPECT_GT(bridge.figure("damaged_packets"), 0u);
  EXPECT_GT(bridge.figure("missed"), 0u);
  EXPECT_GT(bridge.figure("lost"), 0u);
  EXPECT_FALSE(segment_exists(name));
}
INSTANTIATE_TEST_SUITE_P(Modes, BadLine, testing::Values("time-step", "passive"));

// The controller gets the newest of the frames that come while it computes; the others count as skipped.
TEST(Bridge, LateAnswerIsFollowedByTheNewestFrame) {
  const std::string name = surface_name("bridge-newest");
  SteppedDevice device({{"tick", ""}}, {"height"});
  Program bridge({SURFACE_BRIDGE, device.port(), "--shm", name, "--silence", "1000"});
  device.connect();
  auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  device.await(SSW_START, 0);
  const auto expect_frame = [&](std::uint32_t tick, bool skipped) {
    ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
    EXPECT_EQ(controller.sensor<std::uint8_t>(0)[0], tick);
    EXPECT_EQ(controller.sensor_info().tick, tick - 1);
    EXPECT_EQ((controller.sensor_info().status & kLost) != 0, skipped) << tick;
  };
  // The bridge reads the frame while the controller computes.
  const auto send_meanwhile = [&](std::uint32_t tick) {
    device.send_frame(tick);
    device.await(SSW_HEARTBEAT, tick);
  };
  const auto answer = [&](std::uint32_t tick) {
    ASSERT_TRUE(published(controller));
    EXPECT_EQ(device.await(SSW_ACTUATOR_END), tick);
  };
  device.send_frame(1);
  expect_frame(1, false);
  send_meanwhile(2);
  answer(1);
  expect_frame(2, false);
  for (const std::uint32_t tick : {3, 4, 5}) send_meanwhile(tick);
  answer(2);
  expect_frame(5, true);
  // A frame that has come, but is not read yet, is newer than that which waits.
  send_meanwhile(6);
  bridge.signal(SIGSTOP);
  ASSERT_EQ(::waitpid(bridge.pid(), nullptr, WUNTRACED), bridge.pid());
  device.send_frame(7);
  ASSERT_TRUE(published(controller));
  bridge.signal(SIGCONT);
  EXPECT_EQ(device.await(SSW_ACTUATOR_END), 5u);
  expect_frame(7, true);
  answer(7);
  device.send_frame(8);
  expect_frame(8, false);
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130) << bridge.output();
  EXPECT_EQ(bridge.figure("frames"), 5u);
  EXPECT_EQ(bridge.figure("passed_over"), 3u);
  EXPECT_EQ(bridge.figure("lost"), 0u);
}

// Frames that come while the host has no time arrive in one read.
TEST(Bridge, PassiveModePublishesEachFrameOfABurst) {
  const std::string name = surface_name("bridge-burst");
  SteppedDevice device(SteppedDevice::Sensors{{"tick", ""}});
  Program bridge({SURFACE_BRIDGE, device.port(), "--shm", name, "--mode", "passive", "--silence", "1000"});
  device.connect();
  device.await(SSW_START, 0);
  device.send_frame(1);
  device.await(SSW_HEARTBEAT, 1);
  bridge.signal(SIGSTOP);
  ASSERT_EQ(::waitpid(bridge.pid(), nullptr, WUNTRACED), bridge.pid());
  for (std::uint32_t tick = 2; tick <= 21; ++tick) device.send_frame(tick);
  bridge.signal(SIGCONT);
  device.await(SSW_HEARTBEAT, 21);
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130) << bridge.output();
  EXPECT_EQ(bridge.figure("frames"), 21u);
  EXPECT_EQ(bridge.figure("passed_over"), 0u);
  EXPECT_EQ(bridge.figure("lost"), 0u);
}

TEST(Bridge, LateAnswerMakesNoLaterOnesLate) {
  const std::string name = surface_name("bridge-late");
  Device device({"--pty", line_path("late"), "--size", kSize, "--period-ms", "10"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  Checker checker(name);
  while (checker.echoed < 20) checker.tick();
  int at_once = 0, in_time = 0;
  for (int late = 0; late < 100 && at_once < 5; ++late) {
    ASSERT_EQ(checker.controller.await_sensors({.timeout = 100s}), Status::kOk);
    checker.look();
    std::this_thread::sleep_for(15ms);  // more than a period
    checker.answer();
    const auto before = checker.last_tick;
    checker.tick();
    at_once += checker.last_tick == before + 1;
  }
  EXPECT_EQ(at_once, 5) << "frames that came meanwhile, before the next one";
  for (int frame = 0; frame < 1000 && in_time < 10; ++frame) {
    checker.tick();
    in_time = checker.controller.sensor_info().status & kMissed ? 0 : in_time + 1;
  }
  EXPECT_EQ(in_time, 10) << "in a row";
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130);
}

TEST(Bridge, SilentDeviceGetsSafeValuesAndRecovers) {
  const std::string name = surface_name("bridge-silent");
  Device device({"--pty", line_path("silent"), "--size", kSize, "--period-ms", "5", "--silent-for", "200"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--silence", "0.2"});
  Checker checker(name);
  while (checker.echoed < 20) checker.tick();
  device.program.signal(SIGUSR1);
  // Our last frame before the silence was none of zeros; the bridge's safe frames are.
  do checker.tick();
  while (!(checker.controller.sensor_info().status & kAfterSilence) || !checker.safe);
  EXPECT_NE(bridge.output().find("silent for 0.2 s; it is sent the safe frame"), std::string::npos)
      << bridge.output();
  const auto before = checker.echoed;
  while (checker.echoed < before + 20) checker.tick();
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
  EXPECT_GE(bridge.figure("silences"), 1u);
}

// Its period is longer than the least time of a silence.
TEST(Bridge, SlowDeviceFollowsCommands) {
  const std::string name = surface_name("bridge-slow");
  Device device({"--pty", line_path("slow"), "--size", kSize, "--period-ms", "700"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  Checker checker(name);
  for (int frame = 0; frame < 6; ++frame) checker.tick();
  EXPECT_GE(checker.echoed, 2u);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
  EXPECT_EQ(bridge.figure("silences"), 0u) << bridge.output();
}

// The device hears that it may start, but its description is lost in the silence.
TEST(Bridge, TicksOfADeviceThatRestartsUnheardGoOn) {
  const std::string name = surface_name("bridge-restart");
  Device device({"--pty", line_path("restart"), "--size", kSize, "--period-ms", "5", "--silent-for", "120",
                 "--restart"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--silence", "0.2"});
  Checker checker(name);
  while (checker.echoed < 20 || checker.last_tick < 400) checker.tick();  // more than pass in the silence
  device.program.signal(SIGUSR1);
  while (!(checker.controller.sensor_info().status & kAfterSilence)) {
    ASSERT_EQ(checker.controller.await_sensors({.timeout = 100s}), Status::kOk);
    checker.answer();
  }
  EXPECT_LT(checker.controller.sensor_info().tick, 100'000u);
  checker.last_tick = checker.controller.sensor_info().tick;
  checker.forget_offset();
  for (const auto offset : std::exchange(checker.offsets, {})) checker.offsets.insert(offset - 1500);
  const auto before = checker.echoed;
  while (checker.echoed < before + 20) checker.tick();
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130);
  EXPECT_LT(bridge.figure("lost"), 10'000u);
}

class Unplugged : public testing::TestWithParam<std::string> {};

TEST_P(Unplugged, DeviceReturnsInTheSameSession) {
  const std::string name = surface_name("bridge-unplug" + GetParam());
  const std::string where = GetParam() == "pty" ? line_path("unplug") : "0";
  Device device(
      {"--" + GetParam(), where, "--size", kSize, "--period-ms", "5", "--unplug-for", "60", "--restart"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--silence", "20"});
  Checker checker(name);
  const auto session = checker.controller.description().session;
  while (checker.echoed < 20) checker.tick();
  device.program.signal(SIGUSR2);
  for (;;) {
    ASSERT_EQ(checker.controller.await_sensors({.timeout = 100s}), Status::kOk);
    if (checker.controller.sensor_info().status & kAfterSilence) break;
    checker.look();
    checker.answer();
  }
  EXPECT_GT(checker.controller.sensor_info().tick, checker.last_tick)
      << "ticks go on, less what was on the line";
  checker.forget_offset();  // the device began anew
  for (const auto offset : std::exchange(checker.offsets, {})) checker.offsets.insert(offset - 3000);
  checker.look();
  EXPECT_TRUE(checker.safe);
  checker.answer();
  const auto before = checker.echoed;
  while (checker.echoed < before + 20) checker.tick();
  EXPECT_EQ(checker.controller.description().session, session);
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130);
  EXPECT_EQ(bridge.figure("reconnections"), 1u);
  EXPECT_NE(bridge.output().find("the device was restarted"), std::string::npos);
  EXPECT_FALSE(segment_exists(name));
}
INSTANTIATE_TEST_SUITE_P(Lines, Unplugged, testing::Values("pty", "tcp"));

TEST(Bridge, MissingDeviceExitsWithStatusThree) {
  const std::string name = surface_name("bridge-gone");
  Device device({"--pty", line_path("gone"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--replug", "0.1"});
  bridge.await_output("controllers attach");
  device.program.signal(SIGKILL);
  EXPECT_EQ(bridge.wait(), 3) << bridge.output();
  EXPECT_FALSE(segment_exists(name));
  Program never({SURFACE_BRIDGE, line_path("never"), "--shm", name, "--connect", "0.1"});
  EXPECT_EQ(never.wait(), 3);
  const std::string said = never.output();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
}

TEST(Bridge, UnusableDescriptionExitsWithStatusOne) {
  for (const auto& [channels, message] :
       {std::pair<SteppedDevice::Sensors, std::string>{{{"a b", ""}}, "channel \"a b\""},
        {{{"", ""}}, "channel \"\""},
        {{{"a", std::string(16, 'u')}}, "unit \"uuuuuuuuuuuuuuuu\""},
        {{{"a", ""}, {"a", ""}}, "channel 1 'a' of the device: is named twice"}}) {
    SteppedDevice device(channels);
    Program bridge({SURFACE_BRIDGE, device.port(), "--shm", surface_name("bridge-unusable")});
    device.connect();
    device.await_leave();
    EXPECT_EQ(bridge.wait(), 1);
    const std::string said = bridge.output();
    EXPECT_NE(said.find(message), std::string::npos) << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  }
}

TEST(Bridge, UnusableBoardOfATableIsNamed) {
  SteppedDevice device(SteppedDevice::Sensors{{"a", ""}, {"a", ""}});
  const std::string name = surface_name("bridge-unusable-board"), file = line_path(name) + ".toml";
  std::ofstream(file) << "name = \"t\"\nperiod_us = 10000\n\n[[board]]\ndevice = \"" << device.port()
                      << "\"\nat = [0, 0]\n";
  Program bridge({SURFACE_BRIDGE, "--table", file, "--shm", name, "--connect", "4"});
  device.connect();
  device.await_leave();
  EXPECT_EQ(bridge.wait(), 3);
  const std::string place = file + ":4: board '" + device.port() + "': ",
                    why = "channel 1 'a' of the device: is named twice";
  EXPECT_NE(bridge.output().find(place + why + "; it is not used"), std::string::npos) << bridge.output();
  EXPECT_NE(bridge.output().find("error: " + place +
                                 "the device does not come: its description is not valid: " + why),
            std::string::npos)
      << bridge.output();
  std::filesystem::remove(file);
}

// Firmware that hangs falls silent, however often it repeats its frame.
TEST(Bridge, RepeatedFrameIsNoNewFrame) {
  SteppedDevice device(SteppedDevice::Sensors{{"a", ""}});
  Program bridge({SURFACE_BRIDGE, device.port(), "--shm", surface_name("bridge-hangs"), "--silence", "0.1"});
  device.connect();
  for (int frame = 0; frame < 60; ++frame) {
    device.send_frame(5);
    std::this_thread::sleep_for(10ms);
  }
  device.cut();
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
  EXPECT_EQ(bridge.figure("frames"), 1u) << bridge.output();
  EXPECT_EQ(bridge.figure("silences"), 1u) << bridge.output();
}

TEST(Bridge, KilledControllerLeavesDeviceSafe) {
  const std::string name = surface_name("bridge-killed");
  Device device({"--pty", line_path("killed"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  bridge.await_output("controllers attach");
  auto onlooker = shm_protocol::ObserverEndpoint::attach(name, {.timeout = 60s});
  const int echo = onlooker.description().channel(Direction::kSensor, "target_echo");
  // A frame of which all cells, or not all, are at rest; the test's own time-out ends a wait for ever.
  const auto await_rest = [&](bool rest) {
    do ASSERT_EQ(onlooker.await(Direction::kSensor, {.timeout = 100s}), Status::kOk);
    while (std::ranges::all_of(onlooker.array<std::uint8_t>(echo), [](std::uint8_t r) { return r == 0; }) !=
           rest);
  };
  Program apron({APRON, "run", CASE_STUDY, "--shm", name});
  await_rest(false);
  apron.signal(SIGKILL);
  apron.wait();
  bridge.await_output("the controller died; safe values stand");
  await_rest(true);
  {
    Checker next(name);
    while (next.echoed < 20) next.tick();
  }
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130);
  EXPECT_FALSE(segment_exists(name));
}

// An emergency stop sends the safe values in their place.
TEST(Bridge, AnswersThatAStopReplacesAreNotSent) {
  const std::string name = surface_name("bridge-stopped");
  Device device({"--pty", line_path("stopped"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  bridge.await_output("controllers attach");
  Program stop({SURFACE_BRIDGE, "stop", name});
  EXPECT_EQ(stop.wait(), 0) << stop.output();
  Checker checker(name);
  for (int frame = 0; frame < 20; ++frame) checker.tick();
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130);
  EXPECT_EQ(bridge.figure("answers"), 0u) << bridge.output();
}

TEST(Bridge, ReleaseThatIsGivenUpIsNotDoneLater) {
  const std::string name = surface_name("bridge-given-up");
  Device device({"--pty", line_path("given-up"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  bridge.await_output("controllers attach");
  check_commands_that_are_given_up(bridge, name);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
}

std::string ask(const std::string& command, const std::string& name) {
  Program asked({SURFACE_BRIDGE, command, name});
  EXPECT_EQ(asked.wait(), 0) << asked.output();
  return asked.output();
}

// Waits for a frame during an emergency stop.
void await_stop(ControllerEndpoint& controller) {
  constexpr std::uint32_t kStopped = 16;
  do ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
  while (!(controller.sensor_info().status & kStopped) && published(controller));
}

TEST(Bridge, UnpluggedDeviceIsStoppedWhenItIsBack) {
  const std::string name = surface_name("bridge-stop-unplugged");
  Device device(
      {"--pty", line_path("stop-unplugged"), "--size", kSize, "--period-ms", "5", "--unplug-for", "1000"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  device.program.signal(SIGUSR2);
  bridge.await_output("the line to the device is cut");
  EXPECT_NE(ask("status", name).find(" unplugged "), std::string::npos);
  EXPECT_EQ(ask("stop", name), "stopped\n");
  const std::string status = ask("status", name);
  EXPECT_NE(status.find("emergency_stop by the user\nboard b0 unplugged "), std::string::npos) << status;
  await_stop(controller);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
}

TEST(Bridge, AwaitedDeviceIsStoppedWhenItComes) {
  const std::string name = surface_name("bridge-stop-awaited"), line = line_path("stop-awaited");
  Program bridge({SURFACE_BRIDGE, line, "--shm", name, "--connect", "60"});
  for (int status = 1; status != 0;) {  // until the bridge listens
    Program asked({SURFACE_BRIDGE, "stop", name});
    status = asked.wait();
  }
  EXPECT_NE(ask("status", name).find("emergency_stop by the user\nboard " + line + " unplugged "),
            std::string::npos);
  Device device({"--pty", line, "--size", kSize, "--period-ms", "5"});
  auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  await_stop(controller);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 143);
}

TEST(Bridge, InvalidInputIsOneLineError) {
  for (const std::vector<std::string>& flags : {std::vector<std::string>{},
                                                {"a", "b"},
                                                {"tcp:nowhere"},
                                                {"tcp:localhost:99999"},
                                                {"/"},
                                                {SURFACE_BRIDGE},
                                                {"x", "--record", "/no/such/folder/x.h5"},
                                                {"x", "--record", "x.csv"},
                                                {"calibrate", "x.toml", "-o", "/"},
                                                {"calibrate", "x.toml", "-o", "x.svg"},
                                                {"calibrate", "x.toml", "-o", "x"},
                                                {"--table", "x.toml", "--baud", "9600"},
                                                {"/dev/null", "--baud", "1"},
                                                {"x", "--mode", "fast"},
                                                {"x", "--ticks", "0"},
                                                {"x", "--silence", "-1"}}) {
    std::vector<std::string> words{SURFACE_BRIDGE};
    words.insert(words.end(), flags.begin(), flags.end());
    Program bridge(words);
    EXPECT_EQ(bridge.wait(), 2) << bridge.output();
    const std::string said = bridge.output();
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  }
  Program help({SURFACE_BRIDGE, "--help"});
  EXPECT_EQ(help.wait(), 0);
}

TEST(Emulator, LinkReplacesNoFile) {
  const std::string path = line_path("taken");
  const auto refused = [&](const std::string& boards, const std::string& file) {
    Program emulator({DEVICE_EMULATOR, "--pty", path, "--boards", boards, "--ticks", "1"});
    EXPECT_EQ(emulator.wait(), 2);
    EXPECT_EQ(emulator.output(), "device_emulator: error: " + file +
                                     " exists and is no link to a pseudo-terminal; it is not replaced\n");
    EXPECT_TRUE(std::filesystem::exists(std::filesystem::symlink_status(file)));
  };
  std::ofstream(path) << "precious";
  refused("1x1", path);
  EXPECT_EQ(std::filesystem::file_size(path), 8u);
  const std::string second = path + "-1", link = path + "-link";
  std::filesystem::create_symlink(path, second);
  refused("2x1", second);
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(path + "-0"))) << "its own is gone";
  for (const std::string target : {"/dev/pts/0", "/no/such/terminal"}) {
    std::filesystem::create_symlink(target, link);
    Program emulator({DEVICE_EMULATOR, "--pty", link, "--ticks", "1"});
    EXPECT_EQ(emulator.wait(), 0) << emulator.output();
  }
  std::filesystem::remove(second);
  std::filesystem::remove(path);
}

TEST(Emulator, WritesTablesWhoseTextsHoldAnyCharacter) {
  const std::string base = line_path("texts"), link = base + " \"1\"", file = base + ".toml";
  Program emulator({DEVICE_EMULATOR, "--pty", link, "--size", "4x4", "--ticks", "1", "--name", "a \\\"b\"",
                    "--table", file});
  EXPECT_EQ(emulator.wait(), 0) << emulator.output();
  const TableSpec table = read_table(file);
  EXPECT_EQ(table.name, "a \\\"b\"");
  EXPECT_EQ(table.boards.at(0).port.text, link);
  std::filesystem::remove(file);
}

// Neither waits for the device, which is not there.
TEST(Bridge, BadNameOfTheSurfaceIsRefusedAtOnce) {
  const std::string used = surface_name("bridge-used"), file = line_path(used) + ".toml";
  Device device({"--pty", line_path("used"), "--size", kSize, "--period-ms", "5"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", used});
  bridge.await_output("controllers attach");
  std::ofstream(file)
      << "name = \"a b\"\nperiod_us = 10000\n[[board]]\ndevice = \"/dev/none\"\nat = [0, 0]\n";
  for (const auto& [flags, message] :
       {std::pair<std::vector<std::string>, std::string>{{"/dev/none", "--shm", "a/b"},
                                                         "--shm: name \"a/b\""},
        {{"/dev/none", "--shm", used}, "--shm: surface \"" + used + "\""},
        {{"--table", file}, file + ":1: name \"a b\""},
        {{"--table", file, "--shm", ".t"}, "--shm: name \".t\""},
        {{"--table", file, "--shm", std::string(42, 'x')},
         "--shm: name \"" + std::string(42, 'x') + "\": must be 1 to 41"},
        {{"--table", file, "--shm", std::string(49, 'x')},
         "--shm: name \"" + std::string(49, 'x') + "\": must be 1 to 41"},
        {{"calibrate", file, "-o", line_path("c") + ".toml"}, file + ":1: name \"a b\""}}) {
    std::vector<std::string> words{SURFACE_BRIDGE};
    words.insert(words.end(), flags.begin(), flags.end());
    for (const char* word : {"--connect", "1"}) words.push_back(word);
    Program refused(words);
    EXPECT_EQ(refused.wait(), 2) << refused.output();
    const std::string said = refused.output();
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    EXPECT_NE(said.find(message), std::string::npos) << said;
  }
  bridge.signal(SIGINT);  // killed, it would leave its segment behind
  bridge.wait();
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace hardware
