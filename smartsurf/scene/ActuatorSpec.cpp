#include "smartsurf/scene/ActuatorSpec.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

namespace smartsurf::scene {

std::string format_number(double value) {
  if (std::isnan(value)) return "nan";  // streams may print "-nan"
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(12);
  out << value;
  return out.str();
}

std::string Parameter::range_text(double refused) const {
  if (exclusive_minimum && maximum >= 1e6 && !(refused > maximum))
    return "greater than " + format_number(minimum);
  return std::string("in ") + (exclusive_minimum ? "(" : "[") + format_number(minimum) + ", " +
         format_number(maximum) + "]";
}

bool Parameter::accepts(double value) const {
  return std::isfinite(value) && value >= minimum && value <= maximum &&
         !(exclusive_minimum && value == minimum);
}

const Parameter* ActuatorKind::find_parameter(std::string_view name_sought) const {
  const auto it = std::ranges::find(parameters, name_sought, &Parameter::name);
  return it == parameters.end() ? nullptr : &*it;
}

ActuatorSpec ActuatorKind::default_spec() const {
  ActuatorSpec spec{name, {}};
  for (const Parameter& p : parameters)
    if (!p.default_value.empty()) spec.values[p.name] = p.default_value;
  return spec;
}

std::array<double, 2> ActuatorKind::height_limits_of(const ActuatorSpec& spec) const {
  if (height_limits) return height_limits(spec);
  return {spec.number("height"), spec.number("height")};
}

std::string validate_values(const std::string& subject, std::span<const Parameter> parameters,
                            const ParameterValues& all) {
  for (const Parameter& p : parameters) {
    const auto found = all.find(p.name);
    if (found == all.end() || p.type == Parameter::Type::kChoice) continue;
    const std::vector<double>& values = found->second;
    const auto clause = [&](std::size_t i, const std::string& rule) {
      return subject + "." + p.name + (values.size() > 1 ? "[" + std::to_string(i + 1) + "]" : "") + " = " +
             format_number(values[i]) + ": must be " + rule;
    };
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!p.accepts(values[i])) return clause(i, p.range_text(values[i]));
    if (p.type == Parameter::Type::kRange && values[1] < values[0])
      return clause(1, "not below " + subject + "." + p.name + "[1] = " + format_number(values[0]));
  }
  return "";
}

std::string ActuatorKind::validate(const ActuatorSpec& spec) const {
  if (std::string p = validate_values(name, parameters, spec.values); !p.empty()) return p;
  return check_constraints ? check_constraints(spec) : "";
}

std::vector<Parameter> cell_body_parameters() {
  constexpr PinSpec kPin;
  return {{.name = "top",
           .description = "edges of a cell's top along x and y, u",
           .type = Parameter::Type::kSize,
           .default_value = {kPin.top_x, kPin.top_y},
           .minimum = 1e-3},
          {.name = "length",
           .description = "of a cell below its top, u",
           .default_value = {kPin.length},
           .minimum = 1e-3},
          {.name = "height", .description = "of the top at rest, u", .default_value = {0.0}, .minimum = -1e6},
          {.name = "latency",
           .description = "delay of the commands, in control periods",
           .type = Parameter::Type::kCount,
           .default_value = {0.0},
           .minimum = 0.0,
           .maximum = 1000.0}};
}

}  // namespace smartsurf::scene
