// The pins of an emulated device are safe after 16 periods without the bridge, although its line stays open
// and nobody reads it: with firmware whose main loop goes on, and with firmware whose main loop hangs in a
// write. A suspended controller does not make them safe. Safe frames are repeated, because any of them may be
// damaged on the line.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <thread>

#include "shm-protocol/hardware/firmware/wire.h"
#include "tests/system/hardware/Listener.h"
#include "tests/system/hardware/Program.h"
#include "tests/system/hardware/Published.h"

namespace hardware {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kPins = 4096;

// What the emulated device keeps in the file of --pins.
class Pins {
 public:
  // Waits until the device has made the file.
  explicit Pins(const std::string& path) {
    struct stat found {};
    const auto until = Clock::now() + 20s;
    while ((::stat(path.c_str(), &found) != 0 || found.st_size < static_cast<off_t>(kPins)) &&
           Clock::now() < until)
      std::this_thread::sleep_for(1ms);
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    void* memory = ::mmap(nullptr, kPins, PROT_READ, MAP_SHARED, file, 0);
    ::close(file);
    if (memory != MAP_FAILED) bytes_ = static_cast<const volatile std::uint8_t*>(memory);
  }
  ~Pins() { ::munmap(const_cast<std::uint8_t*>(bytes_), kPins); }
  Pins(const Pins&) = delete;
  Pins& operator=(const Pins&) = delete;

  std::size_t up() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < kPins; ++i) count += bytes_[i] != 0;
    return count;
  }

 private:
  const volatile std::uint8_t* bytes_ = nullptr;
};

class UnreadPort : public testing::TestWithParam<const char*> {};

TEST_P(UnreadPort, PinsAreSafeAfterSixteenPeriods) {
  constexpr auto kPeriod = 20ms;
  const std::string name = surface_name(std::string("unread") + GetParam()), line = line_path(name);
  const std::string file = line + ".pins";
  std::vector<std::string> flags{"--pty", line,      "--size", "64x64",  "--period-ms",
                                 "20",    "--queue", "32768",  "--pins", file};
  if (std::string(GetParam()) == "Blocking") flags.push_back("--blocking");
  Device device(flags);
  const Pins pins(file);
  ::unlink(file.c_str());
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name});
  {
    auto controller = shm_protocol::ControllerEndpoint::attach(name, {.timeout = 20s});
    const int height = controller.description().channel(shm_protocol::Direction::kActuator, "height");
    while (pins.up() < kPins) {
      ASSERT_EQ(controller.await_sensors({.timeout = 20s}), shm_protocol::Status::kOk);
      std::ranges::fill(controller.actuator(height), 2.0F);
      ASSERT_TRUE(published(controller));
    }
    // Keeps the line open, as a terminal that another program has opened does.
    const int line_end = ::open(device.name.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(line_end, 0);
    bridge.signal(SIGKILL);
    const auto killed = Clock::now();
    EXPECT_EQ(bridge.wait(), -SIGKILL);
    while (pins.up() > 0 && Clock::now() - killed < 20s) std::this_thread::sleep_for(1ms);
    // What the bridge wrote before its end may still arrive; the rest is the scheduler's.
    EXPECT_LT(Clock::now() - killed, 16 * kPeriod + 1s) << pins.up() << " of " << kPins << " pins are up";
    EXPECT_EQ(pins.up(), 0u);
    std::this_thread::sleep_for(10 * kPeriod);
    EXPECT_EQ(pins.up(), 0u) << "and stay there";
    ::close(line_end);
  }
  ::unlink(("/dev/shm/smartsurf." + name).c_str());
}
INSTANTIATE_TEST_SUITE_P(Firmware, UnreadPort, testing::Values("Dropping", "Blocking"),
                         [](const auto& firmware) { return std::string(firmware.param); });

// The device keeps the last frame: the bridge takes 5 MB of sensor frames a second from the line and sends
// heartbeats.
TEST(SuspendedController, LeavesPinsWhereTheyAre) {
  const std::string name = surface_name("suspended"), line = line_path(name), file = line + ".pins";
  Device device(
      {"--pty", line, "--size", "256x128", "--period-ms", "32", "--queue", "800000", "--pins", file});
  const Pins pins(file);  // the northern 4096 of 32768
  ::unlink(file.c_str());
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--silence", "10"});
  auto controller = shm_protocol::ControllerEndpoint::attach(name, {.timeout = 20s});
  const int height = controller.description().channel(shm_protocol::Direction::kActuator, "height");
  do {
    ASSERT_EQ(controller.await_sensors({.timeout = 20s}), shm_protocol::Status::kOk);
    std::ranges::fill(controller.actuator(height), 2.0F);
    ASSERT_TRUE(published(controller));
  } while (pins.up() < kPins);
  const auto until = Clock::now() + 1500ms;
  std::size_t least = kPins;
  for (; Clock::now() < until; std::this_thread::sleep_for(5ms)) least = std::min(least, pins.up());
  EXPECT_EQ(least, kPins);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 128 + SIGTERM);
}

// A device of version 1 with one cell, whose actuator frames are only counted: none takes effect, as if the
// line damaged each of them.
class DeafDevice {
 public:
  DeafDevice() {
    thread_ = std::thread([this] { run(); });
  }
  ~DeafDevice() {
    over_ = true;
    thread_.join();
    ::close(line_);
  }
  DeafDevice(const DeafDevice&) = delete;
  DeafDevice& operator=(const DeafDevice&) = delete;

  // Waits, 20 s at most, until so many more frames of zeros, or of others, have come.
  testing::AssertionResult await(const std::atomic<int>& frames, int more) const {
    const int before = frames;
    for (const auto until = Clock::now() + 20s; Clock::now() < until; std::this_thread::sleep_for(1ms))
      if (frames - before >= more) return testing::AssertionSuccess();
    return testing::AssertionFailure() << frames - before << " of " << more << " frames came";
  }

  const std::string& port() const { return listener_.port; }
  std::atomic<int> safe = 0, raised = 0;

 private:
  static constexpr auto kPeriod = 10ms;

  void send(std::uint8_t type, std::span<const std::uint8_t> payload) {
    std::array<std::uint8_t, SSW_MAX_ENCODED + 2> encoded;
    const ssw_packet packet{type, sequence_++, tick_, payload.data(), payload.size()};
    (void)::send(line_, encoded.data(), ssw_write(&packet, encoded.data()), MSG_NOSIGNAL);
  }
  void describe() {
    std::array<std::uint8_t, SSW_CHANNEL_BYTES> payload;
    const ssw_hello hello{SSW_VERSION, 2, 1, 1, 10'000, 1, 1, "deaf"};
    ssw_put_hello(&hello, payload.data());
    send(SSW_HELLO, {payload.data(), SSW_HELLO_BYTES});
    for (const ssw_channel& c :
         {ssw_channel{0, SSW_SENSOR, SSW_U8, 1, 0, 1, 0, 1, 0, "hit", ""},
          ssw_channel{1, SSW_ACTUATOR, SSW_U8, 1, 0, 4, 0, 0.02F, 0, "height", "cm"}}) {
      ssw_put_channel(&c, payload.data());
      send(SSW_CHANNEL, payload);
    }
  }
  void hear(const ssw_packet& packet) {
    if (packet.type == SSW_DESCRIBE) describe();
    if (packet.type == SSW_START) running_ = true;
    if (packet.type == SSW_ACTUATOR_DATA) last_ = packet.payload[SSW_DATA_HEADER];
    if (packet.type == SSW_ACTUATOR_END) ++(last_ == 0 ? safe : raised);
  }
  void end_period() {
    ++tick_;
    const std::array<std::uint8_t, SSW_DATA_HEADER + 1> data{};
    const std::array<std::uint8_t, SSW_SENSOR_END_BYTES> end{1};
    send(SSW_SENSOR_DATA, data);
    send(SSW_SENSOR_END, end);
  }
  void run() {
    ssw_receiver receiver;
    ssw_receiver_init(&receiver);
    for (auto next = Clock::now(); !over_;) {
      pollfd ready{line_ < 0 ? listener_.descriptor() : line_, POLLIN, 0};
      ::poll(&ready, 1, 1);
      if (line_ < 0 && (ready.revents & POLLIN)) {
        line_ = listener_.accept();
      } else if (ready.revents & POLLIN) {
        std::array<std::uint8_t, 4096> bytes;
        const ssize_t got = ::read(line_, bytes.data(), bytes.size());
        ssw_packet packet;
        for (ssize_t i = 0; i < got; ++i)
          if (ssw_receive(&receiver, bytes[static_cast<std::size_t>(i)], &packet)) hear(packet);
      }
      if (Clock::now() < next) continue;
      next += kPeriod;
      if (running_) end_period();
    }
  }

  Listener listener_;
  int line_ = -1;
  std::uint8_t sequence_ = 0, last_ = 0;
  std::uint32_t tick_ = 0;
  bool running_ = false;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

// The bridge of that device, alone or as a table of one board.
class SafeFrames : public testing::TestWithParam<const char*> {
 protected:
  void start(const std::string& what, const std::string& mode) {
    name_ = surface_name(what + GetParam());
    std::vector<std::string> words{SURFACE_BRIDGE, device_.port()};
    if (GetParam() == std::string("Table")) {
      file_ = line_path(name_) + ".toml";
      std::ofstream(file_) << "name = 't'\nperiod_us = 10000\n[[board]]\ndevice = '" << device_.port()
                           << "'\nat = [0, 0]\n";
      words = {SURFACE_BRIDGE, "--table", file_};
    }
    for (const std::string& word : {std::string("--shm"), name_, std::string("--mode"), mode})
      words.push_back(word);
    bridge_.emplace(words);
    controller_.emplace(shm_protocol::ControllerEndpoint::attach(name_, {.timeout = 20s}));
  }
  // Answers frames until the device has heard the raised pin.
  void raise() {
    const int height = controller_->description().channel(shm_protocol::Direction::kActuator, "height");
    while (device_.raised == 0) {
      ASSERT_EQ(controller_->await_sensors({.timeout = 20s}), shm_protocol::Status::kOk);
      std::ranges::fill(controller_->actuator(height), 2.0F);
      ASSERT_TRUE(published(*controller_));
    }
  }
  void TearDown() override {
    bridge_->signal(SIGTERM);
    EXPECT_EQ(bridge_->wait(), 128 + SIGTERM) << bridge_->output();
    ::unlink(file_.c_str());
  }

  DeafDevice device_;
  std::string name_, file_;
  std::optional<Program> bridge_;
  std::optional<shm_protocol::ControllerEndpoint> controller_;
};

TEST_P(SafeFrames, AreRepeatedWithoutAControllerInPassiveMode) {
  start("deaf-passive", "passive");
  raise();
  controller_.reset();
  bridge_->await_output("safe values stand");
  EXPECT_TRUE(device_.await(device_.safe, 20));
}

TEST_P(SafeFrames, AreRepeatedWhileAnEmergencyStopLastsAndTheControllerIsSlow) {
  start("deaf-stopped", "time-step");
  raise();
  Program stop({SURFACE_BRIDGE, "stop", name_});
  EXPECT_EQ(stop.wait(), 0) << stop.output();
  EXPECT_TRUE(device_.await(device_.safe, 20));
}
INSTANTIATE_TEST_SUITE_P(Bridges, SafeFrames, testing::Values("Device", "Table"),
                         [](const auto& bridge) { return std::string(bridge.param); });

// The frame is larger than what the line takes at once.
TEST(SafeFrame, WaitsForAFrameInTransmission) {
  const std::string name = surface_name("transmission"), line = line_path(name), file = line + ".pins";
  Device device(
      {"--pty", line, "--size", "400x400", "--period-ms", "500", "--queue", "8000000", "--pins", file});
  const Pins pins(file);
  ::unlink(file.c_str());
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--mode", "passive", "--silence", "10"});
  {
    auto controller = shm_protocol::ControllerEndpoint::attach(name, {.timeout = 20s});
    const int height = controller.description().channel(shm_protocol::Direction::kActuator, "height");
    ASSERT_EQ(controller.await_sensors({.timeout = 20s}), shm_protocol::Status::kOk);
    std::ranges::fill(controller.actuator(height), 2.0F);
    ASSERT_TRUE(published(controller));
    std::this_thread::sleep_for(5ms);  // its first part is on the line
  }
  bridge.await_output("safe values stand");
  const auto until = Clock::now() + 20s;
  for (auto low = Clock::now(); Clock::now() < until && Clock::now() - low < 2s;
       std::this_thread::sleep_for(5ms))
    if (pins.up() != 0) low = Clock::now();
  EXPECT_EQ(pins.up(), 0u);
  bridge.signal(SIGTERM);
  EXPECT_EQ(bridge.wait(), 128 + SIGTERM);
}

}  // namespace
}  // namespace hardware
