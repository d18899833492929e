// The pins of an emulated device are safe after 16 periods without the bridge, although its line stays open
// and nobody reads it: with firmware whose main loop goes on, and with firmware whose main loop hangs in a
// write. A suspended controller does not make them safe.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <span>
#include <thread>

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

}  // namespace
}  // namespace hardware
