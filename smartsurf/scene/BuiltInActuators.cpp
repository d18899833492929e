#include "smartsurf/scene/BuiltInActuators.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;
constexpr double kPi = std::numbers::pi;

std::vector<Parameter> with_body(std::vector<Parameter> own) {
  std::vector<Parameter> all = body_parameters();
  for (Parameter& p : own) all.push_back(std::move(p));
  return all;
}

Parameter limit(std::string name, double standard, std::string meaning) {
  return {.name = std::move(name), .meaning = std::move(meaning), .standard = {standard}, .above_low = true};
}

Parameter number(std::string name, double standard, double low, double high, std::string meaning) {
  return {.name = std::move(name),
          .meaning = std::move(meaning),
          .standard = {standard},
          .low = low,
          .high = high};
}

Parameter choice(std::string name, std::vector<std::string> choices, std::string meaning) {
  return {.name = std::move(name),
          .meaning = std::move(meaning),
          .type = Type::kChoice,
          .standard = {0.0},
          .choices = std::move(choices)};
}

Parameter lag(double standard) {
  return number("lag", standard, 0.0, 1e3, "time constant of the first-order lag, s");
}

// A channel of both signs around 0.
ActuatorChannel signed_channel(std::string name, std::string unit, double most) {
  return {std::move(name), std::move(unit), -most, most, 0.0};
}

ActuatorKind pin() {
  ActuatorKind kind{.name = "pin", .parameters = body_parameters()};
  std::erase_if(kind.parameters, [](const Parameter& p) { return p.name == "height"; });
  kind.parameters.push_back({.name = "range",
                             .meaning = "lowest and highest height of the top, u",
                             .type = Type::kRange,
                             .standard = {0.0, 6.0},
                             .low = -1e6});
  kind.parameters.push_back(limit("max_speed", 20.0, "greatest speed, u/s"));
  kind.parameters.push_back(limit("max_acceleration", 400.0, "greatest acceleration, u/s²"));
  Parameter force =
      limit("max_force", 0.0, "load at which a rising pin stalls, mass·u/s²; without, it never does");
  force.standard.clear();
  kind.parameters.push_back(force);
  kind.channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
    const auto& range = s.numbers("range");
    return {{"height", "u", range[0], range[1], range[0]}};
  };
  kind.heights = [](const ActuatorSpec& s) {
    return std::array{s.numbers("range")[0], s.numbers("range")[1]};
  };
  return kind;
}

ActuatorKind ball() {
  return {.name = "ball",
          .parameters = with_body(
              {limit("radius", 0.4, "of the ball, u"), limit("max_spin", 50.0, "greatest spin, rad/s"),
               limit("max_acceleration", 1000.0, "greatest change of the spin, rad/s²"), lag(0.0)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            const double most = s.number("max_spin");
            return {signed_channel("spin_x", "rad/s", most), signed_channel("spin_y", "rad/s", most)};
          }};
}

ActuatorKind wheels() {
  return {.name = "wheels",
          .parameters = with_body(
              {limit("radius", 0.3, "of each wheel, u"),
               number("angle", 0.0, -2 * kPi, 2 * kPi,
                      "direction in which wheel a drives, rad from east; wheel b is 90° to the left"),
               limit("max_spin", 50.0, "greatest spin, rad/s"),
               limit("max_acceleration", 1000.0, "greatest change of the spin, rad/s²"), lag(0.0)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            const double most = s.number("max_spin");
            return {signed_channel("spin_a", "rad/s", most), signed_channel("spin_b", "rad/s", most)};
          }};
}

std::string rotor_problem(const ActuatorSpec& s) {
  const auto& axis = s.numbers("axis");
  if (std::hypot(axis[0], axis[1], axis[2]) < 1e-6) return "rotor.axis: must not be of length 0";
  if (s.has("points") && s.numbers("points").size() < 12)
    return "rotor.points: must be at least four points {x, y, z}";
  return "";
}

// The shape never leaves the ball of its farthest point.
std::array<double, 2> rotor_heights(const ActuatorSpec& s) {
  const double axle = s.number("height") + s.number("axle");
  double greatest = 0.0;
  if (s.has("points")) {
    const auto& p = s.numbers("points");
    for (std::size_t i = 0; i + 2 < p.size(); i += 3)
      greatest = std::max(greatest, std::hypot(p[i], p[i + 1], p[i + 2]));
  } else {
    for (const double half : s.numbers("half_axes")) greatest = std::max(greatest, half);
  }
  return {axle - greatest, axle + greatest};
}

ActuatorKind rotor() {
  Parameter points{.name = "points",
                   .meaning = "corners of a convex shape about the axle, u, instead of half_axes",
                   .type = Type::kPoints,
                   .low = -1e3,
                   .high = 1e3};
  return {.name = "rotor",
          .parameters = with_body({choice("command", {"rate", "angle"},
                                          "what the channel sets: the rate of turning or the angle"),
                                   {.name = "axis",
                                    .meaning = "the axle's direction",
                                    .type = Type::kVector,
                                    .standard = {0, 1, 0},
                                    .low = -1e3,
                                    .high = 1e3},
                                   {.name = "half_axes",
                                    .meaning = "of the ellipsoid that turns, u",
                                    .type = Type::kVector,
                                    .standard = {0.4, 0.4, 0.6},
                                    .low = 1e-3,
                                    .high = 1e3},
                                   points,
                                   number("axle", -0.5, -1e3, 1e3, "height of the axle, u"),
                                   limit("max_rate", 20.0, "greatest rate of turning, rad/s"),
                                   limit("max_acceleration", 400.0, "greatest change of the rate, rad/s²"),
                                   lag(0.0)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            if (s.number("command") == 1.0) return {signed_channel("angle", "rad", 1000.0)};
            return {signed_channel("rate", "rad/s", s.number("max_rate"))};
          },
          .heights = rotor_heights,
          .problem = rotor_problem};
}

ActuatorKind force_field() {
  return {
      .name = "force_field",
      .parameters = with_body(
          {limit("max_force", 10.0, "greatest force of a cell along each axis, mass·u/s²"),
           limit("reach", 0.5, "height above the cell up to which it acts, u"),
           choice("fall_off", {"linear", "flat", "gaussian"}, "how the force falls with height"), lag(0.0)}),
      .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
        const double most = s.number("max_force");
        return {signed_channel("fx", "mass.u/s2", most), signed_channel("fy", "mass.u/s2", most),
                signed_channel("fz", "mass.u/s2", most)};
      }};
}

ActuatorKind magnet() {
  return {.name = "magnet",
          .parameters = with_body(
              {limit("max_current", 1.0, "greatest current of either sign, A"),
               limit("strength", 100.0, "of the coil at a current of 1"),
               limit("depth", 1.0, "of the coil's centre below the top, u"),
               limit("reach", 6.0, "distance beyond which the coil is not felt, u"),
               choice("law", {"dipole", "pole"}, "the coil as a dipole or as a single pole"), lag(0.01)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            return {signed_channel("current", "A", s.number("max_current"))};
          }};
}

ActuatorKind air_jet() {
  return {.name = "air_jet",
          .parameters =
              with_body({limit("max_flow", 100.0, "greatest speed of the air at the nozzle, u/s"),
                         limit("density", 0.001, "of the air, mass/u³"),
                         limit("drag", 1.2, "drag coefficient of what covers the nozzle"),
                         limit("area", 0.64, "that one jet acts on, u²"),
                         limit("decay", 2.0, "height at which the air is half as fast, u"),
                         limit("reach", 6.0, "height above the cell up to which it acts, u"),
                         number("lean", 0.0, 0.0, kPi / 2, "of the jet from the vertical, rad"), lag(0.02)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            std::vector<ActuatorChannel> all{{"flow", "u/s", 0.0, s.number("max_flow"), 0.0}};
            if (s.number("lean") > 0.0) all.push_back(signed_channel("direction", "rad", 2 * kPi));
            return all;
          }};
}

ActuatorKind tile() {
  return {.name = "tile",
          .parameters = with_body(
              {limit("frequency", 5.0, "of the vibration, Hz"),
               limit("max_amplitude", 0.5, "greatest amplitude, u"),
               number("skin", 0.3, 0.0, 1.0, "how much of its motion a cell takes from its neighbours"),
               number("thickness", 1.0, 0.0, 1e3, "of the skin, u"), lag(0.05)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            return {signed_channel("phase", "rad", 1000.0),
                    {"amplitude", "u", 0.0, s.number("max_amplitude"), 0.0}};
          },
          .heights =
              [](const ActuatorSpec& s) {
                const double height = s.number("height"), most = s.number("max_amplitude");
                return std::array{height - most, height + most};
              }};
}

}  // namespace

std::vector<Parameter> body_parameters() {
  return {{.name = "top",
           .meaning = "edges of a cell's top along x and y, u",
           .type = Type::kSize,
           .standard = {0.8, 0.8},
           .low = 1e-3},
          {.name = "length", .meaning = "of a cell below its top, u", .standard = {2.0}, .low = 1e-3},
          {.name = "height", .meaning = "of the top at rest, u", .standard = {0.0}, .low = -1e6},
          {.name = "latency",
           .meaning = "control periods until a command is felt",
           .type = Type::kCount,
           .standard = {0.0},
           .low = 0.0,
           .high = 1000.0}};
}

std::vector<ActuatorKind> built_in_actuators() {
  return {pin(), ball(), wheels(), rotor(), force_field(), magnet(), air_jet(), tile()};
}

}  // namespace smartsurf::scene
