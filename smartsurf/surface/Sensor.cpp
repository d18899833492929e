#include "smartsurf/surface/Sensor.h"

#include <map>
#include <string>

#include "smartsurf/surface/Camera.h"
#include "smartsurf/surface/Colour.h"
#include "smartsurf/surface/Light.h"
#include "smartsurf/surface/ObjectType.h"
#include "smartsurf/surface/Pressure.h"
#include "smartsurf/surface/Proximity.h"

namespace smartsurf::surface {
namespace {

template <class Model>
std::unique_ptr<Sensor> make(const Field& field, const scene::SensorSpec& spec) {
  return std::make_unique<Model>(field, spec);
}

std::map<std::string, SensorFactory>& factories() {
  static std::map<std::string, SensorFactory> all{
      {"proximity", make<Proximity>}, {"colour", make<Colour>},     {"object_type", make<ObjectType>},
      {"light", make<Light>},         {"pressure", make<Pressure>}, {"camera", make<Camera>}};
  return all;
}

}  // namespace

void add_sensor(scene::SensorKind kind, SensorFactory make) {
  factories()[kind.name] = std::move(make);
  scene::add_sensor_kind(std::move(kind));
}

std::unique_ptr<Sensor> make_sensor(const Field& field, const scene::SensorSpec& spec) {
  const auto it = factories().find(spec.model);
  if (it == factories().end()) throw scene::InputError("no sensor is called '" + spec.model + "'");
  return it->second(field, spec);
}

Segment segment_of(const scene::SensorSpec& spec) {
  return {.origin = spec.vector("origin").cast<float>(),
          .direction = spec.vector("direction").normalized().cast<float>(),
          .range = static_cast<float>(spec.number("range")),
          .pins = spec.number("pins") != 0.0};
}

}  // namespace smartsurf::surface
