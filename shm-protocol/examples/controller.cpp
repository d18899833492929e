// A controller in C++: pins under an object go down, all others up.
#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <cstdio>

using namespace shm_protocol;

static int fail(int status, const char* what) {
  std::fprintf(stderr, "%s\n", what);
  return status;
}

// The index of a float32 channel with one component, or -1.
static int find(const Description& table, Direction direction, const char* name) {
  const int channel = table.channel(direction, name);
  if (channel < 0) return -1;
  const ChannelSpec& found = table.channels[channel];
  return found.dtype == DType::kF32 && found.components == 1 ? channel : -1;
}

int main(int argc, char** argv) try {
  auto table =
      ControllerEndpoint::attach(argc > 1 ? argv[1] : "surface", {.timeout = std::chrono::seconds(10)});
  const int hit = find(table.description(), Direction::kSensor, "proximity_hit");
  const int height = find(table.description(), Direction::kActuator, "height");
  if (hit < 0 || height < 0) return fail(2, "no float32 proximity_hit or height");

  Status status;
  while ((status = table.await_sensors()) == Status::kOk) {
    std::ranges::transform(table.sensor(hit), table.actuator(height).begin(),
                           [](float in) { return in > 0 ? 0.0f : 4.0f; });
    if (table.publish() != Status::kOk) break;
  }
  std::fprintf(stderr, "%s\n", text(status));
  return status == Status::kSurfaceClosed ? 0 : 3;
} catch (const Error& e) {
  return fail(3, e.what());
}
