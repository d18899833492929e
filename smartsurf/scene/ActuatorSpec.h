// The kinds of actuators and their parameters: names, units, ranges. Plain values; the models are in
// `smartsurf/surface`.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace smartsurf::scene {

// One thing that a user may set of an actuator.
struct Parameter {
  enum class Type {
    kNumber,
    kCount,      // an integer
    kFlag,       // true or false: 1 or 0
    kSize,       // two numbers along x and y; a user may give one for both
    kRange,      // {lowest, highest}
    kVector,     // {x, y, z}
    kChoice,     // one of `choices`; its value is the index
    kPointList,  // a list of {x, y, z}, flat
  };
  std::string name;
  std::string description;  // one clause, with the unit
  Type type = Type::kNumber;
  std::vector<double> default_value = {};  // where the user says nothing; empty: then it has no value
  double minimum = 0.0, maximum = 1e6;     // each number lies in [low, high]
  bool exclusive_minimum = false;          // … and is not `low` itself
  std::vector<std::string> choices = {};

  // "in [0, 1]", "greater than 0".
  std::string range_text() const;
  bool accepts(double value) const;
};

// One array of commands: a target for each cell.
struct ActuatorChannel {
  std::string name, unit;
  double minimum = 0.0, maximum = 1.0;  // finite; commands are clamped to it
  double safe_value = 0.0;  // what a cell aims at before the first command, and a dead one for ever
};

using ParameterValues = std::map<std::string, std::vector<double>, std::less<>>;

// One actuator as the user set it: a model by name, and the values of all its parameters that have one.
struct ActuatorSpec {
  std::string model = "pin";
  ParameterValues values;

  bool has(std::string_view parameter) const { return values.contains(parameter); }
  // Preconditions: the parameter has a value.
  double number(std::string_view parameter) const { return numbers(parameter).front(); }
  const std::vector<double>& numbers(std::string_view parameter) const {
    return values.find(parameter)->second;
  }
};

// A model's name with its parameters and channels.
struct ActuatorKind {
  std::string name;
  std::vector<Parameter> parameters = {};
  // The channels of an actuator with these values, in the order in which its model counts them.
  std::function<std::vector<ActuatorChannel>(const ActuatorSpec&)> channels = {};
  // The lowest and the highest z of the top over the cell's base. May be absent: both are the parameter
  // `height`.
  std::function<std::array<double, 2>(const ActuatorSpec&)> height_limits = {};
  // Rules between parameters: "" or one clause, "pin.range[2] = 0: must be …". May be absent.
  std::function<std::string(const ActuatorSpec&)> check_constraints = {};

  const Parameter* find_parameter(std::string_view) const;  // null: none of that name
  ActuatorSpec default_spec() const;                        // every parameter at its standard value
  std::array<double, 2> height_limits_of(const ActuatorSpec&) const;
  std::string validate(const ActuatorSpec&) const;  // "" or one clause
};

// What every cell has, whatever moves it: `top`, `length`, `height` (of the top at rest) and `latency`.
// A list of parameters begins with these.
std::vector<Parameter> cell_body_parameters();

// All kinds, the built-in ones first. Not thread-safe against add_actuator_kind().
std::span<const ActuatorKind> actuator_kinds();
const ActuatorKind* find_actuator_kind(std::string_view name);
// Adds a kind, or replaces the one of that name; before any experiment is loaded.
void add_actuator_kind(ActuatorKind);

}  // namespace smartsurf::scene
