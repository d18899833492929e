#include "smartsurf/scene/BuiltInSensors.h"

#include <numbers>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;

constexpr double kMostForce = 1e6;  // mass·u/s², what a pressure reading ends at unless told otherwise
constexpr double kMostTypes = 1e6;  // of objects: no scene has more labels
constexpr int kMostPixels = 4;      // a cell edge: 3 colours of 4 × 4 pixels fit into 64 components

SensorKind proximity() {
  return {
      .name = "proximity",
      .parameters = segment_parameters(8.0),
      .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
        const double range = s.number("range");
        return {{s.name, "u", 0.0, range, range}, {.name = s.name + "_hit", .maximum = 1.0, .exact = true}};
      },
      .mask = 1,
      .problem = problem_with_segment};
}

SensorKind colour() {
  return {.name = "colour",
          .parameters = segment_parameters(8.0),
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{.name = s.name, .components = 3}};
          },
          .problem = problem_with_segment};
}

SensorKind object_type() {
  return {
      .name = "object_type",
      .parameters = segment_parameters(8.0),
      .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
        return {{.name = s.name, .maximum = kMostTypes, .type = SensorChannel::Type::kCount, .exact = true}};
      },
      .problem = problem_with_segment};
}

SensorKind light() {
  SensorKind kind{.name = "light", .parameters = segment_parameters(1000.0)};
  kind.parameters.push_back({.name = "size",
                             .meaning = "angle that the light's radius is seen under, rad; 0: a point",
                             .standard = {0.0},
                             .high = std::numbers::pi / 4});
  kind.parameters.push_back({.name = "samples",
                             .meaning = "points of the light that are looked for, where it has a size",
                             .type = Type::kCount,
                             .standard = {16.0},
                             .low = 1.0,
                             .high = 256.0});
  kind.channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
    return {{.name = s.name, .maximum = 1.0, .none = 1.0}};
  };
  kind.problem = [](const SensorSpec& s) -> std::string {
    if (std::string p = problem_with_segment(s); !p.empty()) return p;
    return s.vector("direction").z() > 0.0
               ? ""
               : "direction: must point up, to the light: its third number must be > 0";
  };
  return kind;
}

SensorKind pressure() {
  return {.name = "pressure",
          .parameters = {{.name = "range",
                          .meaning = "the greatest force it tells, mass·u/s²",
                          .standard = {kMostForce},
                          .high = 1e12,
                          .above_low = true}},
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{s.name, "mass*u/s^2", 0.0, s.number("range"), 0.0}};
          }};
}

SensorKind camera() {
  SensorKind kind{.name = "camera"};
  kind.parameters = {{.name = "resolution",
                      .meaning = "pixels along the edge of a cell",
                      .type = Type::kCount,
                      .standard = {1.0},
                      .low = 1.0,
                      .high = kMostPixels},
                     {.name = "height",
                      .meaning = "z from where it looks down, u; what is above it is not seen",
                      .standard = {100.0},
                      .low = -1e6},
                     {.name = "floor",
                      .meaning = "z of what lies below the pins, u: the height where it sees nothing",
                      .standard = {-2.0},
                      .low = -1e6}};
  kind.channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
    const int pixels = static_cast<int>(s.number("resolution") * s.number("resolution"));
    const double floor = s.number("floor");
    return {{.name = s.name, .components = 3 * pixels},
            {s.name + "_height", "u", floor, s.number("height"), floor, pixels}};
  };
  kind.problem = [](const SensorSpec& s) -> std::string {
    if (s.number("floor") < s.number("height")) return "";
    return "floor = " + text_of(s.number("floor")) + ": must be below the height, " +
           text_of(s.number("height"));
  };
  return kind;
}

}  // namespace

std::vector<SensorKind> built_in_sensors() {
  return {proximity(), colour(), object_type(), light(), pressure(), camera()};
}

}  // namespace smartsurf::scene
