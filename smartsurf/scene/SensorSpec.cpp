#include "smartsurf/scene/SensorSpec.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/scene/ChannelName.h"

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;

Parameter fraction_parameter(std::string name, std::string description) {
  return {.name = std::move(name), .description = std::move(description), .maximum = 1.0};
}

}  // namespace

const Parameter* SensorKind::find_parameter(std::string_view name_sought) const {
  const auto own = std::ranges::find(parameters, name_sought, &Parameter::name);
  if (own != parameters.end()) return &*own;
  const auto shared = std::ranges::find(sensor_error_parameters(), name_sought, &Parameter::name);
  return shared == sensor_error_parameters().end() ? nullptr : &*shared;
}

SensorSpec SensorKind::default_spec() const {
  SensorSpec spec{name, name, {}, {}};
  for (const Parameter& p : parameters)
    if (!p.default_value.empty()) spec.values[p.name] = p.default_value;
  return spec;
}

bool is_channel_name(std::string_view name) {
  return !name.empty() && name.size() <= kMaxChannelNameLength && name[0] != '.' &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-") ==
             std::string_view::npos;
}

std::string SensorKind::validate(const SensorSpec& spec) const {
  if (std::string p = validate_values(name, parameters, spec.values); !p.empty()) return p;
  if (std::string p = validate_sensor_errors(name, spec.values); !p.empty()) return p;
  if (const auto rate = spec.values.find("false_hits");
      rate != spec.values.end() && rate->second.front() > 0.0 && !has_false_hits())
    return name + ".false_hits = " + format_number(rate->second.front()) + ": must be 0: the sensor has no " +
           (extension.name.empty() ? "channel of detections" : "false hits, being of an extension");
  const std::string constraint_error = check_constraints ? check_constraints(spec) : "";
  return constraint_error.empty() ? "" : name + "." + constraint_error;
}

std::span<const Parameter> sensor_error_parameters() {
  static const std::vector<Parameter> all{
      {.name = "noise",
       .description = "standard deviation of each reading's Gaussian noise, in the channel's unit"},
      {.name = "quantize", .description = "step of the readings, in the channel's unit"},
      {.name = "latency",
       .description = "delay of the readings, in control periods",
       .type = Type::kCount,
       .maximum = 100.0},
      fraction_parameter("dropout", "probability that a reading is lost and shows no detection"),
      fraction_parameter(
          "false_hits",
          "probability that a cell that detects nothing reports a detection at a random distance"),
      {.name = "drift",
       .description =
           "standard deviation of each cell's random walk after one second, in the channel's unit"},
      fraction_parameter("stuck_low", "fraction of cells that always read the minimum"),
      fraction_parameter("stuck_high", "fraction of cells that always read the maximum"),
      fraction_parameter("dead", "fraction of cells that never detect anything")};
  return all;
}

std::string validate_sensor_errors(const std::string& subject, const ParameterValues& values) {
  if (std::string p = validate_values(subject, sensor_error_parameters(), values); !p.empty()) return p;
  double faulty_fraction = 0.0;
  for (const char* const fault : {"stuck_low", "stuck_high", "dead"})
    if (const auto found = values.find(fault); found != values.end())
      faulty_fraction += found->second.front();
  return faulty_fraction <= 1.0 ? ""
                                : subject + ": stuck_low, stuck_high and dead add up to " +
                                      format_number(faulty_fraction) + ": must be at most 1";
}

std::vector<Parameter> ray_parameters(double range) {
  return {{.name = "range",
           .description = "length of the segment, u",
           .default_value = {range},
           .exclusive_minimum = true},
          {.name = "direction",
           .description = "of the segment, any length but 0; turned with its cell",
           .type = Type::kVector,
           .default_value = {0.0, 0.0, 1.0},
           .minimum = -1e6},
          {.name = "origin",
           .description = "of the segment, from the centre of the cell's top, u; turned with its cell",
           .type = Type::kVector,
           .default_value = {0.0, 0.0, 0.0},
           .minimum = -1e6},
          {.name = "pins",
           .description = "whether pins block the ray",
           .type = Type::kFlag,
           .default_value = {1.0},
           .maximum = 1.0}};
}

std::string validate_ray(const SensorSpec& spec) {
  return spec.vector("direction").norm() >= 1e-6 ? "" : "direction: must not be of length 0";
}

}  // namespace smartsurf::scene
