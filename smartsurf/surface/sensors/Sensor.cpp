#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

CellRay cell_ray_of(const scene::SensorSpec& spec) {
  return {.origin = spec.vector("origin").cast<float>(),
          .direction = spec.vector("direction").normalized().cast<float>(),
          .range = static_cast<float>(spec.number("range")),
          .hits_pins = spec.number("pins") != 0.0};
}

}  // namespace smartsurf::surface
