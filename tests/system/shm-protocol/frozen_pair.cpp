// A surface and its controller in one process that take so many ticks and then stand still until standard
// input ends: something to look at.
//   frozen_pair NAME ROWS COLUMNS TICKS
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <limits>

int main(int argc, char** argv) {
  using namespace shm_protocol;
  if (argc != 5) return 2;
  SurfaceConfig config;
  config.name = argv[1];
  config.rows = static_cast<std::uint32_t>(std::atoi(argv[2]));
  config.columns = static_cast<std::uint32_t>(std::atoi(argv[3]));
  config.period_ns = 10'000'000;
  config.channels = {{"spot", Direction::kSensor, DType::kU8, 1, "", 0, 1, 0},
                     {"height", Direction::kActuator, DType::kF32, 2, "m", -1, 1, 0}};
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  const auto ticks = static_cast<std::uint64_t>(std::atoi(argv[4]));
  for (std::uint64_t tick = 0; tick < ticks; ++tick) {
    auto spot = surface.sensor<std::uint8_t>(0);
    std::ranges::fill(spot, std::uint8_t{0});
    spot[tick % spot.size()] = 1;
    if (surface.publish(tick, static_cast<double>(tick) * 0.01) != Status::kOk) return 1;
    if (controller.await_sensors() != Status::kOk) return 1;
    auto height = controller.actuator(1);
    std::ranges::fill(height, -0.5f);
    height.front() = std::numeric_limits<float>::quiet_NaN();
    height.back() = 0.5f;
    if (controller.publish() != Status::kOk || surface.await_actuators(tick) != Status::kOk) return 1;
  }
  std::puts("frozen");
  std::fflush(stdout);
  while (std::getchar() != EOF) {
  }
}
