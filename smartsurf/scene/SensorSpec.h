// Sensors as values: what parameters and channels a kind has, and a sensor's parameters. The models
// themselves are in smartsurf/surface, all kinds in KindRegistry.h.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

// An array of readings with `components` numbers per cell.
struct SensorChannel {
  enum class Type { kFloat32, kUint32 };  // data type in the protocol: f32 or u32

  std::string name;       // ≤ 31 letters, digits and _: the sensor's name with optional suffix
  std::string unit = {};  // "" = dimensionless
  double minimum = 0.0, maximum = 1.0;  // finite; limits of the readings
  double no_detection = 0.0;            // reading of a cell that senses nothing
  int components = 1;                   // 1 … 64
  Type type = Type::kFloat32;
  // A class or a mask, not a quantity: has no noise, drift, calibration or quantization.
  bool is_exact = false;
  // The ray along which a channel measures distances, from the centre of the cell's top, in the cell's frame.
  std::optional<std::array<double, 3>> origin = {}, direction = {};
};

// A rule of the shared-memory protocol for the names of all channels, and the rule in words.
bool is_channel_name(std::string_view name);
inline constexpr const char* kChannelNameRule = "1 to 31 letters, digits, '_', '.' and '-', not a dot first";

// A table of per-cell calibration values (docs/sensors.md).
struct CalibrationFile {
  std::string name;  // path as given by the user
  std::string text;  // the file's content
};

// A configured sensor: its model and the values of its parameters.
struct SensorSpec {
  std::string model = "proximity";
  std::string name = "proximity";
  ParameterValues values;
  std::optional<CalibrationFile> calibration;

  bool has(std::string_view parameter) const { return values.contains(parameter); }
  // All require has(parameter).
  double number(std::string_view parameter) const { return numbers(parameter).front(); }
  const std::vector<double>& numbers(std::string_view parameter) const {
    return values.find(parameter)->second;
  }
  Eigen::Vector3d vector(std::string_view parameter) const {
    return Eigen::Vector3d(numbers(parameter).data());
  }
};

// A sensor model: its name, parameters and channels.
struct SensorKind {
  std::string name;  // of the model, and the default name of its sensors
  std::vector<Parameter> parameters = {};
  // The channels of a sensor with these values, in the order in which the model indexes them.
  std::function<std::vector<SensorChannel>(const SensorSpec&)> channels = {};
  // Index of the channel that is non-zero in cells that detect something; sensor errors apply only there.
  // -1 = every cell always measures.
  int mask_channel = -1;
  // Checks constraints between parameters. Returns "" or one clause, "direction: must not be …". May be null.
  std::function<std::string(const SensorSpec&)> check_constraints = {};
  Extension extension = {};

  // True if the sensor error false_hits is defined: the mask follows the first channel, as proximity's does.
  bool has_false_hits() const { return mask_channel > 0 && extension.name.empty(); }
  // Searches `parameters`, then sensor_error_parameters(). Null if there is none.
  const Parameter* find_parameter(std::string_view) const;
  SensorSpec default_spec() const;  // all parameters that have a default
  // Returns "" or one clause that begins with the sensor's model: "proximity.range = 0: must be …".
  std::string validate(const SensorSpec&) const;
};

// The parameters of the sensor error model, which every sensor has besides its own.
std::span<const Parameter> sensor_error_parameters();
// Returns "" or one clause that begins with `subject`.
std::string validate_sensor_errors(const std::string& subject, const ParameterValues&);

// The parameters of models that cast one ray per cell: `range`, `direction`, `origin` and `pins`.
std::vector<Parameter> ray_parameters(double range);
// Checks the constraints on ray_parameters(). Returns "" or one clause.
std::string validate_ray(const SensorSpec&);

}  // namespace smartsurf::scene
