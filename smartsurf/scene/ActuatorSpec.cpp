#include "smartsurf/scene/ActuatorSpec.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/scene/BuiltInActuators.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {
namespace {

std::vector<ActuatorKind>& registry() {
  static std::vector<ActuatorKind> kinds = built_in_actuators();
  return kinds;
}

}  // namespace

std::string Parameter::rule() const {
  if (above_low && high >= 1e6) return "greater than " + text_of(low);
  return std::string("in ") + (above_low ? "(" : "[") + text_of(low) + ", " + text_of(high) + "]";
}

bool Parameter::allows(double value) const {
  return std::isfinite(value) && value >= low && value <= high && !(above_low && value == low);
}

const Parameter* ActuatorKind::parameter(std::string_view wanted) const {
  const auto it = std::ranges::find(parameters, wanted, &Parameter::name);
  return it == parameters.end() ? nullptr : &*it;
}

ActuatorSpec ActuatorKind::standard() const {
  ActuatorSpec spec{name, {}};
  for (const Parameter& p : parameters)
    if (!p.standard.empty()) spec.values[p.name] = p.standard;
  return spec;
}

std::array<double, 2> ActuatorKind::heights_of(const ActuatorSpec& spec) const {
  if (heights) return heights(spec);
  return {spec.number("height"), spec.number("height")};
}

std::string ActuatorKind::problem_with(const ActuatorSpec& spec) const {
  for (const Parameter& p : parameters) {
    if (!spec.has(p.name) || p.type == Parameter::Type::kChoice) continue;
    const std::vector<double>& values = spec.numbers(p.name);
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!p.allows(values[i]))
        return name + "." + p.name + (values.size() > 1 ? "[" + std::to_string(i + 1) + "]" : "") + " = " +
               text_of(values[i]) + ": must be " + p.rule();
    if (p.type == Parameter::Type::kRange && values[1] < values[0])
      return name + "." + p.name + "[2] = " + text_of(values[1]) + ": must be not below " + name + "." +
             p.name + "[1] = " + text_of(values[0]);
  }
  return problem ? problem(spec) : "";
}

std::span<const ActuatorKind> actuator_kinds() { return registry(); }

const ActuatorKind* find_actuator_kind(std::string_view name) {
  const auto it = std::ranges::find(registry(), name, &ActuatorKind::name);
  return it == registry().end() ? nullptr : &*it;
}

void add_actuator_kind(ActuatorKind kind) {
  const auto it = std::ranges::find(registry(), kind.name, &ActuatorKind::name);
  if (it == registry().end())
    registry().push_back(std::move(kind));
  else
    *it = std::move(kind);
}

}  // namespace smartsurf::scene
