// What must not grow: memory, descriptors, mappings and files, over many ticks and over many starts and ends.
// By default short; SHM_PROTOCOL_SOAK=1 takes ten million ticks and a thousand starts.
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

template <class T>
T full(T all, T usual) {
  return std::getenv("SHM_PROTOCOL_SOAK") ? all : usual;
}

// Pages of this process that are in memory.
long resident_pages() {
  std::ifstream file("/proc/self/statm");
  long total = 0, resident = 0;
  file >> total >> resident;
  return resident;
}

std::ptrdiff_t open_descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

std::ptrdiff_t mappings() {
  std::ifstream file("/proc/self/maps");
  return std::count(std::istreambuf_iterator<char>(file), {}, '\n');
}

// Over all values of all frames, in order: FNV-1a.
class Checksum {
 public:
  void add(std::span<const float> values) {
    for (const float v : values) sum_ = (sum_ ^ static_cast<std::uint32_t>(v)) * 0x100000001B3;
  }
  std::uint64_t value() const { return sum_; }

 private:
  std::uint64_t sum_ = 0xCBF29CE484222325;
};

// What one side has to tell at its end.
struct ResourceUsage {
  std::uint64_t ticks = 0, sensors = 0, actuators = 0;
  long pages_early = 0, pages_late = 0;
};

// Keeps the account of a side: `turn` is called for each tick and adds to the two sums.
template <class Turn>
int keep(ResourceUsage& account, std::uint64_t ticks, Turn&& turn) {
  Checksum sensors, actuators;
  (void)resident_pages();  // the first look brings in pages of its own
  for (std::uint64_t tick = 0; tick < ticks; ++tick) {
    if (turn(tick, sensors, actuators) != Status::kOk) return 1;
    if (tick == ticks / 10) account.pages_early = resident_pages();
  }
  account = {ticks, sensors.value(), actuators.value(), account.pages_early, resident_pages()};
  return 0;
}

TEST(Endurance, MemoryStaysConstantAndBothSidesAgree) {
  auto config = pair_config("endurance");
  config.rows = config.columns = 4;
  const auto ticks = full<std::uint64_t>(10'000'000, 30'000);
  auto* accounts = static_cast<ResourceUsage*>(
      ::mmap(nullptr, 2 * sizeof(ResourceUsage), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(accounts, MAP_FAILED);
  Peer surface([&] {
    auto own = SurfaceEndpoint::create(config);
    if (own.await_controller({.timeout = 20s}) != Status::kOk) return 2;
    return keep(accounts[0], ticks, [&](std::uint64_t tick, Checksum& sensors, Checksum& actuators) {
      fill(own.sensor(0), tick, sensed);
      sensors.add(own.sensor(0));
      Status s = own.publish(tick, 0.0);
      if (s == Status::kOk) s = own.await_actuators(tick, {.timeout = 100s});
      actuators.add(own.actuator(1));
      return s;
    });
  });
  Peer controller([&] {
    auto own = ControllerEndpoint::attach(config.name, {.timeout = 20s});
    return keep(accounts[1], ticks, [&](std::uint64_t tick, Checksum& sensors, Checksum& actuators) {
      const Status s = own.await_sensors({.timeout = 100s});
      if (s != Status::kOk || own.sensor_info().tick != tick) return Status::kTorn;
      sensors.add(own.sensor(0));
      fill(own.actuator(1), tick, commanded);
      actuators.add(own.actuator(1));
      return own.publish();
    });
  });
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_EQ(controller.wait(), 0);
  const ResourceUsage a = accounts[0], b = accounts[1];
  ::munmap(accounts, 2 * sizeof(ResourceUsage));
  EXPECT_EQ(a.ticks, ticks);
  EXPECT_EQ(a.sensors, b.sensors);
  EXPECT_EQ(a.actuators, b.actuators);
  for (const ResourceUsage& side : {a, b}) EXPECT_LE(side.pages_late, side.pages_early + 16);
  RecordProperty("pages_surface", std::to_string(a.pages_late));
  RecordProperty("pages_controller", std::to_string(b.pages_late));
}

// Either side may end first; whatever one start takes, its end gives back.
TEST(Endurance, StartsAndStopsLeakNothing) {
  const auto config = pair_config("starts");
  const int cycles = full(1000, 60);
  std::ptrdiff_t descriptors = 0, maps = 0;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    auto surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
    auto controller = std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(config.name));
    for (std::uint64_t tick = 0; tick < 3; ++tick) {
      ASSERT_EQ(surface->publish(tick, 0.0), Status::kOk);
      ASSERT_EQ(controller->await_sensors(), Status::kOk);
      ASSERT_EQ(controller->publish(), Status::kOk);
      ASSERT_EQ(surface->await_actuators(tick), Status::kOk);
    }
    if (cycle % 2) surface.reset();
    controller.reset();
    surface.reset();
    ASSERT_FALSE(exists(file_path(config.name)));
    if (cycle == 3) descriptors = open_descriptors(), maps = mappings();  // the heap has settled
  }
  EXPECT_EQ(open_descriptors(), descriptors);
  EXPECT_EQ(mappings(), maps);
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm"))
    EXPECT_FALSE(entry.path().filename().string().starts_with("smartsurf." + config.name)) << entry.path();
}

}  // namespace
}  // namespace shm_protocol
