// Both endpoints while their peer writes anything anywhere: neither reads or writes outside, no actuator
// value leaves its range, no wait hangs.
#include <fcntl.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "Patches.h"

namespace {

using namespace shm_protocol;

// The segment as mapped by another process of the same user.
class RawMapping {
 public:
  explicit RawMapping(const std::string& name) {
    const int file = ::open(("/dev/shm/smartsurf." + name).c_str(), O_RDWR | O_CLOEXEC);
    bytes_ = static_cast<std::size_t>(::lseek(file, 0, SEEK_END));
    memory_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ::close(file);
    if (memory_ == MAP_FAILED) std::abort();
  }
  ~RawMapping() { ::munmap(memory_, bytes_); }
  std::span<std::byte> all() { return {static_cast<std::byte*>(memory_), bytes_}; }

 private:
  void* memory_;
  std::size_t bytes_;
};

volatile float sink;

void use(SurfaceEndpoint& surface, ControllerEndpoint& controller, ObserverEndpoint& observer,
         std::uint8_t what, std::uint64_t tick) {
  constexpr WaitOptions kNow{.timeout = std::chrono::nanoseconds(0)};
  if (what & 1) (void)surface.publish(tick, 0.0);
  if (what & 2) (void)controller.await_sensors(kNow);
  if (what & 4) (void)controller.latest_sensors();
  if (what & 8) (void)controller.publish();
  if (what & 16) (void)surface.await_actuators(tick, kNow);
  if (what & 32) (void)surface.latest_actuators();
  if (what & 64) (void)observer.latest(Direction::kSensor);
  if (what & 128) (void)observer.latest(Direction::kActuator);
  surface.sensor(0)[0] = 1.0f;
  controller.actuator(1)[0] = 1.0f;
  sink = controller.sensor(0).back() + observer.array(0).back() + observer.array(1).back();
  (void)observer.controller_state();
  (void)surface.controller_counters();
  for (const float v : surface.actuator(1))
    if (!(v >= -1.0f && v <= 4.0f)) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Patches patches(data, size);
  SurfaceConfig config;
  config.name = "fuzz-" + std::to_string(::getpid());
  config.rows = config.columns = 3;
  config.period_ns = 1'000'000;
  config.mode = patches.byte() & 1 ? Mode::kPassive : Mode::kTimeStep;
  config.channels = {{"distance", Direction::kSensor, DType::kF32, 1, "u", 0, 8, 8},
                     {"height", Direction::kActuator, DType::kF32, 1, "u", -1, 4, 0.5}};
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  auto observer = ObserverEndpoint::attach(config.name);
  RawMapping stranger(config.name);
  std::uint64_t tick = 0;
  do {
    use(surface, controller, observer, patches.byte(), tick++);
  } while (tick < 200 && patches.apply(stranger.all().subspan(128)));
  return 0;
}
