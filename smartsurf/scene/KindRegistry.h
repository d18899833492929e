// The kinds of actuators and sensors: the built-in ones, and those that extensions add. All functions are
// thread-safe, and pointers to kinds stay valid.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"
#include "smartsurf/scene/SensorSpec.h"

namespace smartsurf::scene {

// All kinds, built-in ones first.
std::vector<const ActuatorKind*> actuator_kinds();
std::vector<const SensorKind*> sensor_kinds();
// Null if there is none.
const ActuatorKind* find_actuator_kind(std::string_view name);
const SensorKind* find_sensor_kind(std::string_view name);
// Precondition: no kind has this name.
void add_actuator_kind(ActuatorKind);
void add_sensor_kind(SensorKind);

// The extensions that have been loaded, in order; every one has added a kind.
std::vector<Extension> loaded_extensions();

// The channels of all sensors, in the order of the sensors.
std::vector<SensorChannel> collect_channels(std::span<const SensorSpec>);

}  // namespace smartsurf::scene
