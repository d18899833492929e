// The sensor models by name, built-in and registered.
#pragma once

#include <functional>
#include <memory>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// `field` gives the cell geometry and must not be retained.
using SensorFactory = std::function<std::unique_ptr<Sensor>(const Field& field, const scene::SensorSpec&)>;

// Registers the model under the kind's name, which no other kind has, for scripts, the protocol and all
// surfaces created later. Thread-safe.
void register_sensor(scene::SensorKind kind, SensorFactory make);

// Creates the model that the spec names. Throws scene::InputError if no such model is registered.
std::unique_ptr<Sensor> make_sensor(const Field&, const scene::SensorSpec&);

}  // namespace smartsurf::surface
