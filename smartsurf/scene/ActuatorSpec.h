// Actuators as values: what parameters and channels a kind has, and an actuator's parameters. The models
// themselves are in smartsurf/surface, all kinds in KindRegistry.h.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace smartsurf::scene {

// Formats a number for messages, with 12 significant digits in the C locale.
std::string format_number(double);

// The body of every cell, a rectangular pin, and the motion limits of cells with a pin actuator.
struct PinSpec {
  double top_x = 0.8, top_y = 0.8;  // edge lengths of the top, ≤ pitch
  double length = 2.0;
  double min_height = 0.0, max_height = 6.0;  // z of the top, over all cells
  double max_speed = 20.0;                    // u/s
  double max_acceleration = 400.0;            // u/s²
};

// A parameter of an actuator or sensor that a user may set.
struct Parameter {
  enum class Type {
    kNumber,
    kCount,      // an integer
    kFlag,       // 1 = true, 0 = false
    kSize,       // {x, y}; a single number in a script sets both
    kRange,      // {minimum, maximum}
    kVector,     // {x, y, z}
    kChoice,     // an index into `choices`
    kPointList,  // points {x, y, z}, flattened
  };
  std::string name;         // "group.name": the field `name` of the table `group`
  std::string description;  // one clause, with the unit
  Type type = Type::kNumber;
  std::vector<double> default_value = {};  // empty = no default, the parameter is optional
  double minimum = 0.0, maximum = 1e6;     // limits of each number, inclusive
  bool exclusive_minimum = false;          // excludes `minimum` itself
  std::vector<std::string> choices = {};

  // The limits in words, for a value that they refuse: "in [0, 1]", "greater than 0".
  std::string range_text(double refused) const;
  bool accepts(double value) const;
};

// An array of commands with one target per cell.
struct ActuatorChannel {
  std::string name, unit;
  double minimum = 0.0, maximum = 1.0;  // finite; commands are clamped to this range
  double safe_value = 0.0;              // the target before the first command, and always of a dead cell
};

using ParameterValues = std::map<std::string, std::vector<double>, std::less<>>;

// Checks all values against the limits of their parameters. Returns "" or one clause that begins with
// `subject`.
std::string validate_values(const std::string& subject, std::span<const Parameter>, const ParameterValues&);

// A configured actuator: its model and the values of its parameters.
struct ActuatorSpec {
  std::string model = "pin";
  ParameterValues values;

  bool has(std::string_view parameter) const { return values.contains(parameter); }
  // Both require has(parameter).
  double number(std::string_view parameter) const { return numbers(parameter).front(); }
  const std::vector<double>& numbers(std::string_view parameter) const {
    return values.find(parameter)->second;
  }
};

// A shared object that adds actuators and sensors (docs/extending.md). Recordings name it, because their runs
// need it.
struct Extension {
  std::string name;  // of its file, "belt.so"; "" for what is built in
  std::string hash;  // of its content, 16 hexadecimal digits
  bool operator==(const Extension&) const = default;
};

// An actuator model: its name, parameters and channels.
struct ActuatorKind {
  std::string name;
  std::vector<Parameter> parameters = {};
  // The channels of an actuator with these values, in the order in which the model indexes them.
  std::function<std::vector<ActuatorChannel>(const ActuatorSpec&)> channels = {};
  // The minimum and maximum z of the top relative to the cell's base. Null = both are the parameter `height`.
  std::function<std::array<double, 2>(const ActuatorSpec&)> height_limits = {};
  // The radius of the disc about 0 in which the first two channels lie together. Null = each has its own
  // range.
  std::function<double(const ActuatorSpec&)> disc_radius = {};
  // Checks constraints between parameters. Returns "" or one clause, "pin.range[2] = 0: must be …". May be
  // null.
  std::function<std::string(const ActuatorSpec&)> check_constraints = {};
  Extension extension = {};

  const Parameter* find_parameter(std::string_view) const;  // null if there is none
  ActuatorSpec default_spec() const;                        // all parameters that have a default
  std::array<double, 2> height_limits_of(const ActuatorSpec&) const;
  std::string validate(const ActuatorSpec&) const;  // "" or one clause
};

// The parameters that all actuator kinds share and list first: `top`, `length`, `height` (of the top at rest)
// and `latency`.
std::vector<Parameter> cell_body_parameters();

}  // namespace smartsurf::scene
