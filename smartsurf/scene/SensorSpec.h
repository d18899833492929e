// The kinds of sensors and their parameters: names, units, ranges. Plain values; the models are in
// `smartsurf/surface`.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

// One array of readings, `components` numbers for each cell.
struct SensorChannel {
  enum class Type { kFloat32, kUint32 };  // f32 and u32 on the protocol

  std::string name;  // at most 31 letters, digits and _; that of the sensor, and a word of its own after it
  std::string unit = {};                // "" is dimensionless
  double minimum = 0.0, maximum = 1.0;  // finite; no reading lies outside
  double no_detection = 0.0;            // what a cell reads that senses nothing
  int components = 1;                   // 1 … 64
  Type type = Type::kFloat32;
  // A class or a mask, not a quantity: without noise, drift, calibration and steps.
  bool is_exact = false;
};

// A table of single cells that a user measured (docs/sensors.md).
struct CalibrationFile {
  std::string name;  // as the user gave it
  std::string text;  // what is in it
};

// One sensor as the user set it: a model by name, and the values of all its parameters that have one.
struct SensorSpec {
  std::string model = "proximity";
  std::string name = "proximity";
  ParameterValues values;
  std::optional<CalibrationFile> calibration;

  bool has(std::string_view parameter) const { return values.contains(parameter); }
  // Preconditions: the parameter has a value.
  double number(std::string_view parameter) const { return numbers(parameter).front(); }
  const std::vector<double>& numbers(std::string_view parameter) const {
    return values.find(parameter)->second;
  }
  Eigen::Vector3d vector(std::string_view parameter) const {
    return Eigen::Vector3d(numbers(parameter).data());
  }
};

// A model's name with its parameters and channels.
struct SensorKind {
  std::string name;  // of the model; a sensor's own name is the same unless the user says otherwise
  std::vector<Parameter> parameters = {};
  // The channels of a sensor with these values, in the order in which its model counts them.
  std::function<std::vector<SensorChannel>(const SensorSpec&)> channels = {};
  // The channel that says, by not being 0, which cells sense anything at all: there is nothing to disturb
  // elsewhere. -1: every cell always measures.
  int mask_channel = -1;
  // Rules between parameters: "" or one clause, "direction: must not be …". May be absent.
  std::function<std::string(const SensorSpec&)> check_constraints = {};

  const Parameter* find_parameter(std::string_view) const;  // null: none of that name, nor an imperfection
  SensorSpec default_spec() const;                          // every parameter at its standard value
  // "" or one clause that begins with the sensor's model: "proximity.range = 0: must be …".
  std::string validate(const SensorSpec&) const;
};

// What keeps a reading from the truth; every sensor takes these beside its own parameters.
std::span<const Parameter> sensor_error_parameters();
// "" or one clause that begins with `what`.
std::string validate_sensor_errors(const std::string& subject, const ParameterValues&);

// `range`, `direction`, `origin` and `pins`, of models that look along one segment a cell.
std::vector<Parameter> ray_parameters(double range);
// The rules that these have among themselves.
std::string validate_ray(const SensorSpec&);

// All kinds, the built-in ones first. Not thread-safe against add_sensor_kind().
std::span<const SensorKind> sensor_kinds();
const SensorKind* find_sensor_kind(std::string_view name);
// Adds a kind, or replaces the one of that name; before any experiment is loaded.
void add_sensor_kind(SensorKind);

// The channels of all these sensors, in their order.
std::vector<SensorChannel> collect_channels(std::span<const SensorSpec>);

}  // namespace smartsurf::scene
