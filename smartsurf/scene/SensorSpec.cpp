#include "smartsurf/scene/SensorSpec.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/scene/BuiltInSensors.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;

std::vector<SensorKind>& registry() {
  static std::vector<SensorKind> kinds = built_in_sensors();
  return kinds;
}

Parameter share(std::string name, std::string meaning) {
  return {.name = std::move(name), .meaning = std::move(meaning), .high = 1.0};
}

// Each value within its parameter's limits: "" or one clause.
std::string problem_with_values(const std::string& what, std::span<const Parameter> parameters,
                                const ParameterValues& values) {
  for (const Parameter& p : parameters) {
    const auto found = values.find(p.name);
    if (found == values.end()) continue;
    for (std::size_t i = 0; i < found->second.size(); ++i)
      if (!p.allows(found->second[i]))
        return what + "." + p.name + (found->second.size() > 1 ? "[" + std::to_string(i + 1) + "]" : "") +
               " = " + text_of(found->second[i]) + ": must be " + p.rule();
  }
  return "";
}

}  // namespace

const Parameter* SensorKind::parameter(std::string_view wanted) const {
  const auto own = std::ranges::find(parameters, wanted, &Parameter::name);
  if (own != parameters.end()) return &*own;
  const auto common = std::ranges::find(imperfections(), wanted, &Parameter::name);
  return common == imperfections().end() ? nullptr : &*common;
}

SensorSpec SensorKind::standard() const {
  SensorSpec spec{name, name, {}, {}};
  for (const Parameter& p : parameters)
    if (!p.standard.empty()) spec.values[p.name] = p.standard;
  return spec;
}

std::string SensorKind::problem_with(const SensorSpec& spec) const {
  if (std::string p = problem_with_values(name, parameters, spec.values); !p.empty()) return p;
  if (std::string p = problem_with_imperfections(name, spec.values); !p.empty()) return p;
  const std::string between = problem ? problem(spec) : "";
  return between.empty() ? "" : name + "." + between;
}

std::span<const Parameter> imperfections() {
  static const std::vector<Parameter> all{
      {.name = "noise",
       .meaning = "standard deviation of each reading's Gaussian noise, in the channel's unit"},
      {.name = "quantize", .meaning = "step of the readings, in the channel's unit"},
      {.name = "latency",
       .meaning = "control periods by which a reading is late",
       .type = Type::kCount,
       .high = 100.0},
      share("dropout", "probability that a reading is lost and reads as nothing"),
      {.name = "drift",
       .meaning = "standard deviation of each cell's random walk after one second, in the channel's unit"},
      share("stuck_low", "share of the cells that always read the least value"),
      share("stuck_high", "share of the cells that always read the greatest"),
      share("dead", "share of the cells that never sense anything")};
  return all;
}

std::string problem_with_imperfections(const std::string& what, const ParameterValues& values) {
  if (std::string p = problem_with_values(what, imperfections(), values); !p.empty()) return p;
  double hit = 0.0;
  for (const char* const part : {"stuck_low", "stuck_high", "dead"})
    if (const auto found = values.find(part); found != values.end()) hit += found->second.front();
  return hit <= 1.0
             ? ""
             : what + ": stuck_low, stuck_high and dead are " + text_of(hit) + " together: must be at most 1";
}

std::vector<Parameter> segment_parameters(double range) {
  return {{.name = "range", .meaning = "length of the segment, u", .standard = {range}, .above_low = true},
          {.name = "direction",
           .meaning = "of the segment, any length but 0; turned with its cell",
           .type = Type::kVector,
           .standard = {0.0, 0.0, 1.0},
           .low = -1e6},
          {.name = "origin",
           .meaning = "of the segment, from the centre of the cell's top, u; turned with its cell",
           .type = Type::kVector,
           .standard = {0.0, 0.0, 0.0},
           .low = -1e6},
          {.name = "pins",
           .meaning = "whether pins are in the way as well",
           .type = Type::kFlag,
           .standard = {1.0},
           .high = 1.0}};
}

std::string problem_with_segment(const SensorSpec& spec) {
  return spec.vector("direction").norm() >= 1e-6 ? "" : "direction: must not be of length 0";
}

std::span<const SensorKind> sensor_kinds() { return registry(); }

const SensorKind* find_sensor_kind(std::string_view name) {
  const auto it = std::ranges::find(registry(), name, &SensorKind::name);
  return it == registry().end() ? nullptr : &*it;
}

void add_sensor_kind(SensorKind kind) {
  const auto it = std::ranges::find(registry(), kind.name, &SensorKind::name);
  if (it == registry().end())
    registry().push_back(std::move(kind));
  else
    *it = std::move(kind);
}

std::vector<SensorChannel> channels_of(std::span<const SensorSpec> sensors) {
  std::vector<SensorChannel> all;
  for (const SensorSpec& sensor : sensors)
    for (SensorChannel& channel : find_sensor_kind(sensor.model)->channels(sensor))
      all.push_back(std::move(channel));
  return all;
}

}  // namespace smartsurf::scene
