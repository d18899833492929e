// The actuator models by name, built-in and registered.
#pragma once

#include <functional>
#include <memory>

#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

using ActuatorFactory = std::function<std::unique_ptr<Actuator>(const ActuatorContext&)>;

// Registers the model under the kind's name, which no other kind has, for scripts, the protocol and all
// surfaces created later. Thread-safe.
void register_actuator(scene::ActuatorKind kind, ActuatorFactory make);

// Creates the model that context.spec names. Throws scene::InputError if no such model is registered.
std::unique_ptr<Actuator> make_actuator(const ActuatorContext& context);

}  // namespace smartsurf::surface
