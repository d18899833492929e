// A controller in C++: pins under an object go down, all others up.
#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <cstdio>

int main(int argc, char** argv) try {
  using namespace shm_protocol;
  auto table =
      ControllerEndpoint::attach(argc > 1 ? argv[1] : "surface", {.timeout = std::chrono::seconds(10)});
  const int hit = table.description().channel(Direction::kSensor, "proximity_hit");
  const int height = table.description().channel(Direction::kActuator, "height");
  if (hit < 0 || height < 0) return std::fprintf(stderr, "no proximity_hit or no height\n"), 2;

  Status status;
  while ((status = table.await_sensors()) == Status::kOk) {
    std::ranges::transform(table.sensor(hit), table.actuator(height).begin(),
                           [](float in) { return in > 0 ? 0.0f : 4.0f; });
    if (table.publish() != Status::kOk) break;
  }
  std::fprintf(stderr, "%s\n", text(status));
  return status == Status::kSurfaceClosed ? 0 : 3;
} catch (const shm_protocol::Error& e) {
  return std::fprintf(stderr, "%s\n", e.what()), 3;
}
