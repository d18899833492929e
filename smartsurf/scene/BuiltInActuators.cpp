#include "smartsurf/scene/BuiltInActuators.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/scene/Delta.h"

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;
constexpr double kPi = std::numbers::pi;
constexpr PinSpec kPin;  // the defaults of a cell's body and of a pin

std::vector<Parameter> with_body_parameters(std::vector<Parameter> parameters) {
  std::vector<Parameter> all = cell_body_parameters();
  for (Parameter& p : parameters) all.push_back(std::move(p));
  return all;
}

Parameter positive_parameter(std::string name, double default_value, std::string description) {
  return {.name = std::move(name),
          .description = std::move(description),
          .default_value = {default_value},
          .exclusive_minimum = true};
}

Parameter force_parameter(double default_value, std::string description) {
  Parameter force = positive_parameter("max_force", default_value, std::move(description));
  force.maximum = 1e12;
  return force;
}

Parameter stiffness_parameter(std::string description) {
  Parameter stiffness = positive_parameter("stiffness", 0.0, std::move(description));
  stiffness.maximum = 1e12;
  return stiffness;
}

Parameter number_parameter(std::string name, double default_value, double minimum, double maximum,
                           std::string description) {
  return {.name = std::move(name),
          .description = std::move(description),
          .default_value = {default_value},
          .minimum = minimum,
          .maximum = maximum};
}

Parameter choice_parameter(std::string name, std::vector<std::string> choices, std::string description) {
  return {.name = std::move(name),
          .description = std::move(description),
          .type = Type::kChoice,
          .default_value = {0.0},
          .choices = std::move(choices)};
}

Parameter lag_parameter(double default_value) {
  return number_parameter("lag", default_value, 0.0, 1e3, "time constant of the first-order lag, s");
}

Parameter range_parameter(std::string name, double low, double high, std::string description) {
  return {.name = std::move(name),
          .description = std::move(description),
          .type = Type::kRange,
          .default_value = {low, high},
          .minimum = -1e6};
}

Parameter optional(Parameter p) {
  p.default_value.clear();
  return p;
}

// For cells whose height is that of a command.
std::vector<Parameter> without_height(std::vector<Parameter> parameters) {
  std::erase_if(parameters, [](const Parameter& p) { return p.name == "height"; });
  return parameters;
}

// A channel with the range [-limit, limit].
ActuatorChannel symmetric_channel(std::string name, std::string unit, double limit) {
  return {std::move(name), std::move(unit), -limit, limit, 0.0};
}

// ---- tips of pins

const std::vector<std::string> kTipShapes{"flat", "hemisphere", "cone", "rounded_square"};

std::string check_tip(const ActuatorSpec& s) {
  const std::string& shape = kTipShapes[static_cast<int>(s.number("tip.shape"))];
  const auto only_with = [&](const char* parameter,
                             std::initializer_list<std::string_view> shapes) -> std::string {
    if (!s.has(parameter) || std::ranges::find(shapes, shape) != shapes.end()) return "";
    return std::string("pin.") + parameter + ": a tip of the shape '" + shape + "' has none";
  };
  if (s.has("max_force") && shape != "flat")
    return "pin.max_force: a tip of the shape '" + shape + "' has none; only flat pins are of limited force";
  if (s.has("stiffness") && shape != "flat")
    return "pin.stiffness: a tip of the shape '" + shape + "' has none; only flat pins yield";
  if (s.has("stiffness") && s.has("max_force"))
    return "pin.stiffness: excludes pin.max_force; a pin has one of them";
  if (s.has("damping") && !s.has("stiffness"))
    return "pin.damping: needs pin.stiffness; a rigid pin has none";
  if (auto p = only_with("tip.radius", {"hemisphere", "cone"}); !p.empty()) return p;
  if (auto p = only_with("tip.half_angle", {"cone"}); !p.empty()) return p;
  return only_with("tip.corner_radius", {"rounded_square"});
}

ActuatorKind pin_kind() {
  return {.name = "pin",
          .parameters = without_height(with_body_parameters(
              {range_parameter("range", kPin.min_height, kPin.max_height,
                               "lowest and highest height of the top, u"),
               positive_parameter("max_speed", kPin.max_speed, "greatest speed, u/s"),
               positive_parameter("max_acceleration", kPin.max_acceleration, "greatest acceleration, u/s²"),
               lag_parameter(0.0),
               optional(
                   force_parameter(0.0, "load at which a rising pin stalls, mass·u/s²; unlimited if absent")),
               optional(
                   stiffness_parameter("of the pin under a load on its whole top, mass/s²; rigid if absent")),
               optional(number_parameter(
                   "damping", 0.0, 0.0, 1e12,
                   "of a pin with a stiffness, mass/s; 0.02 s times the stiffness if absent")),
               choice_parameter("tip.shape", kTipShapes, "of the pin's upper end"),
               optional(positive_parameter(
                   "tip.radius", 0.0,
                   "of a hemisphere or of a cone's foot, u; half of the top's shorter edge if absent")),
               optional(number_parameter("tip.half_angle", 0.0, 0.05, 1.5,
                                         "of a cone at its apex, rad; π/4 if absent")),
               optional(positive_parameter(
                   "tip.corner_radius", 0.0,
                   "of a rounded square's corners, u; a quarter of the top's shorter edge if absent"))})),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            const auto& range = s.numbers("range");
            return {{"height", "u", range[0], range[1], range[0]}};
          },
          .height_limits =
              [](const ActuatorSpec& s) {
                return std::array{s.numbers("range")[0], s.numbers("range")[1]};
              },
          .check_constraints = check_tip};
}

ActuatorKind ball_kind() {
  return {.name = "ball",
          .parameters = with_body_parameters(
              {positive_parameter("radius", 0.4, "of the ball, u"),
               positive_parameter("max_spin", 50.0, "greatest spin, rad/s"),
               positive_parameter("max_acceleration", 1000.0, "greatest change of the spin, rad/s²"),
               lag_parameter(0.0)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            const double limit = s.number("max_spin");
            return {symmetric_channel("spin_x", "rad/s", limit), symmetric_channel("spin_y", "rad/s", limit)};
          }};
}

ActuatorKind wheels_kind() {
  return {
      .name = "wheels",
      .parameters = with_body_parameters(
          {positive_parameter("radius", 0.3, "of each wheel, u"),
           number_parameter("angle", 0.0, -2 * kPi, 2 * kPi,
                            "direction in which wheel a drives, rad from east; wheel b is 90° to the left"),
           positive_parameter("max_spin", 50.0, "greatest spin, rad/s"),
           positive_parameter("max_acceleration", 1000.0, "greatest change of the spin, rad/s²"),
           lag_parameter(0.0)}),
      .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
        const double limit = s.number("max_spin");
        return {symmetric_channel("spin_a", "rad/s", limit), symmetric_channel("spin_b", "rad/s", limit)};
      }};
}

ActuatorKind conveyor_kind() {
  return {.name = "conveyor",
          .parameters = with_body_parameters(
              {positive_parameter("max_speed", 5.0, "greatest speed of the top along x and along y, u/s"),
               positive_parameter("max_acceleration", 50.0, "greatest change of either speed, u/s²"),
               positive_parameter("max_turn", 10.0, "greatest spin about the cell's centre, rad/s"),
               positive_parameter("max_turn_acceleration", 100.0, "greatest change of the spin, rad/s²"),
               lag_parameter(0.0), range_parameter("lift", 0.0, 0.0, "lowest and highest lift of the top, u"),
               positive_parameter("lift_speed", 1.0, "greatest speed of the lift, u/s"),
               positive_parameter("lift_acceleration", 50.0, "greatest acceleration of the lift, u/s²")}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            const double speed = s.number("max_speed");
            std::vector<ActuatorChannel> all{symmetric_channel("drive_x", "u/s", speed),
                                             symmetric_channel("drive_y", "u/s", speed),
                                             symmetric_channel("turn", "rad/s", s.number("max_turn"))};
            const auto& lift = s.numbers("lift");
            if (lift[0] < lift[1])
              all.push_back({"lift", "u", lift[0], lift[1], std::clamp(0.0, lift[0], lift[1])});
            return all;
          },
          .height_limits =
              [](const ActuatorSpec& s) {
                const auto& lift = s.numbers("lift");
                return std::array{s.number("height") + lift[0], s.number("height") + lift[1]};
              }};
}

std::string check_rotor(const ActuatorSpec& s) {
  const auto& axis = s.numbers("axis");
  if (std::hypot(axis[0], axis[1], axis[2]) < 1e-6) return "rotor.axis: must not be of length 0";
  if (s.has("points") && s.numbers("points").size() < 12)
    return "rotor.points: must be at least four points {x, y, z}";
  return "";
}

// Bounds the shape by the sphere around the axle through its farthest point.
std::array<double, 2> rotor_height_limits(const ActuatorSpec& s) {
  const double axle_height = s.number("height") + s.number("axle");
  double max_radius = 0.0;
  if (s.has("points")) {
    const auto& p = s.numbers("points");
    for (std::size_t i = 0; i + 2 < p.size(); i += 3)
      max_radius = std::max(max_radius, std::hypot(p[i], p[i + 1], p[i + 2]));
  } else {
    for (const double half : s.numbers("half_axes")) max_radius = std::max(max_radius, half);
  }
  return {axle_height - max_radius, axle_height + max_radius};
}

ActuatorKind rotor_kind() {
  Parameter points{.name = "points",
                   .description = "corners of a convex shape about the axle, u, instead of half_axes",
                   .type = Type::kPointList,
                   .minimum = -1e3,
                   .maximum = 1e3};
  return {.name = "rotor",
          .parameters = with_body_parameters(
              {choice_parameter("command", {"rate", "angle"},
                                "what the channel sets: the rate of turning or the angle"),
               {.name = "axis",
                .description = "the axle's direction",
                .type = Type::kVector,
                .default_value = {0, 1, 0},
                .minimum = -1e3,
                .maximum = 1e3},
               {.name = "half_axes",
                .description = "of the ellipsoid that turns, u",
                .type = Type::kVector,
                .default_value = {0.4, 0.4, 0.6},
                .minimum = 1e-3,
                .maximum = 1e3},
               points,
               number_parameter("axle", -0.5, -1e3, 1e3, "height of the axle, u"),
               positive_parameter("max_rate", 20.0, "greatest rate of turning, rad/s"),
               positive_parameter("max_acceleration", 400.0, "greatest change of the rate, rad/s²"),
               lag_parameter(0.0)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            if (s.number("command") == 1.0) return {symmetric_channel("angle", "rad", 1000.0)};
            return {symmetric_channel("rate", "rad/s", s.number("max_rate"))};
          },
          .height_limits = rotor_height_limits,
          .check_constraints = check_rotor};
}

ActuatorKind force_field_kind() {
  return {
      .name = "force_field",
      .parameters = with_body_parameters(
          {force_parameter(10.0, "greatest force of a cell along each axis, mass·u/s²"),
           positive_parameter("reach", 0.5, "height above the cell up to which it acts, u"),
           choice_parameter("fall_off", {"linear", "flat", "gaussian"}, "how the force falls with height"),
           lag_parameter(0.0)}),
      .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
        const double limit = s.number("max_force");
        return {symmetric_channel("fx", "mass.u/s2", limit), symmetric_channel("fy", "mass.u/s2", limit),
                symmetric_channel("fz", "mass.u/s2", limit)};
      }};
}

ActuatorKind magnet_kind() {
  return {.name = "magnet",
          .parameters = with_body_parameters(
              {positive_parameter("max_current", 1.0, "greatest current of either sign, A"),
               positive_parameter("strength", 100.0, "of the coil at a current of 1"),
               positive_parameter("depth", 1.0, "of the coil's centre below the top, u"),
               positive_parameter("reach", 6.0, "distance beyond which the coil has no effect, u"),
               choice_parameter("law", {"dipole", "pole"}, "the coil as a dipole or as a single pole"),
               lag_parameter(0.01)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            return {symmetric_channel("current", "A", s.number("max_current"))};
          }};
}

ActuatorKind air_jet_kind() {
  return {.name = "air_jet",
          .parameters = with_body_parameters(
              {positive_parameter("max_flow", 100.0, "greatest speed of the air at the nozzle, u/s"),
               positive_parameter("density", 0.001, "of the air, mass/u³"),
               positive_parameter("drag", 1.2, "drag coefficient of an object above the nozzle"),
               positive_parameter("area", 0.64, "on which one jet acts, u²"),
               positive_parameter("decay", 2.0, "height at which the air is half as fast, u"),
               positive_parameter("reach", 6.0, "height above the cell up to which it acts, u"),
               number_parameter("lean", 0.0, 0.0, kPi / 2, "of the jet from the vertical, rad"),
               lag_parameter(0.02)}),
          .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
            std::vector<ActuatorChannel> all{{"flow", "u/s", 0.0, s.number("max_flow"), 0.0}};
            if (s.number("lean") > 0.0) all.push_back(symmetric_channel("direction", "rad", 2 * kPi));
            return all;
          }};
}

bool takes_pose(const ActuatorSpec& tile) { return tile.number("command") == 1.0; }

std::string check_tile(const ActuatorSpec& s) {
  if (takes_pose(s) && s.number("thickness") < 1e-3)
    return "tile.thickness = " + format_number(s.number("thickness")) +
           ": must be at least 0.001 where the command is a pose";
  return "";
}

ActuatorKind tile_kind() {
  return {
      .name = "tile",
      .parameters = with_body_parameters(
          {choice_parameter("command", {"wave", "pose"},
                            "what the channels set: a vibration, or heave, roll and pitch"),
           positive_parameter("frequency", 5.0, "of the vibration, Hz"),
           positive_parameter("max_amplitude", 0.5, "greatest amplitude, u"),
           number_parameter("skin", 0.3, 0.0, 1.0, "fraction of a cell's motion that follows its neighbours"),
           number_parameter("thickness", 1.0, 0.0, 1e3, "of the skin, or of the plate that tilts, u"),
           lag_parameter(0.05), range_parameter("heave", 0.0, 1.0, "lowest and highest heave, u"),
           number_parameter("max_tilt", 0.35, 0.0, 1.2, "greatest roll and greatest pitch, rad"),
           positive_parameter("max_speed", 5.0, "greatest speed of the heave, u/s"),
           positive_parameter("max_acceleration", 100.0, "greatest acceleration of the heave, u/s²"),
           positive_parameter("max_tilt_rate", 5.0, "greatest rate of roll and pitch, rad/s"),
           positive_parameter("max_tilt_acceleration", 100.0, "greatest change of that rate, rad/s²")}),
      .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
        if (takes_pose(s)) {
          const auto& heave = s.numbers("heave");
          return {{"heave", "u", heave[0], heave[1], std::clamp(0.0, heave[0], heave[1])},
                  symmetric_channel("roll", "rad", s.number("max_tilt")),
                  symmetric_channel("pitch", "rad", s.number("max_tilt"))};
        }
        return {symmetric_channel("phase", "rad", 1000.0),
                {"amplitude", "u", 0.0, s.number("max_amplitude"), 0.0}};
      },
      .height_limits =
          [](const ActuatorSpec& s) {
            const double height = s.number("height"), limit = s.number("max_amplitude");
            const auto& heave = s.numbers("heave");
            if (takes_pose(s)) return std::array{height + heave[0], height + heave[1]};
            return std::array{height - limit, height + limit};
          },
      .check_constraints = check_tile};
}

// ---- delta robots

std::string check_delta(const ActuatorSpec& s) {
  const auto only_with = [&](const char* parameter, const char* needed) -> std::string {
    if (!s.has(parameter) || s.has(needed)) return "";
    return std::string("delta.") + parameter + ": needs delta." + needed;
  };
  if (auto p = only_with("damping", "stiffness"); !p.empty()) return p;
  const Delta delta(s);
  if (s.has("tip.length") && delta.tip_shape == DeltaTipShape::kSphere)
    return "delta.tip.length: a tip of the shape 'sphere' has none";
  if (delta.tip_length < 2.0 * delta.tip_radius)
    return "delta.tip.length = " + format_number(delta.tip_length) +
           ": must be at least the diameter of the tip, " + format_number(2.0 * delta.tip_radius);
  const double reach = delta.workspace_radius + delta.joint_radius;
  if (delta.arm_length <= reach)
    return "delta.arms.length = " + format_number(delta.arm_length) +
           ": must be greater than workspace.radius + arms.radius = " + format_number(reach) +
           ", to reach the whole workspace";
  return "";
}

ActuatorKind delta_kind() {
  const auto optional_size = [](std::string name, std::string description) {
    return optional(number_parameter(std::move(name), 0.0, 0.0, 1e12, std::move(description)));
  };
  const auto optional_positive = [&](std::string name, std::string description) {
    Parameter p = optional_size(std::move(name), std::move(description));
    p.exclusive_minimum = true;
    return p;
  };
  return {
      .name = "delta",
      .parameters = without_height(with_body_parameters(
          {choice_parameter("tip.shape", {"sphere", "rounded_cylinder"}, "of the tip"),
           positive_parameter("tip.radius", 0.25, "of the sphere or cylinder, u"),
           optional_positive("tip.length", "of a rounded cylinder, u; twice its diameter if absent"),
           positive_parameter("workspace.radius", 0.5,
                              "greatest distance of the tip from the cell's axis, u"),
           range_parameter("workspace.z", 0.0, 2.0, "lowest and highest z of the tip's highest point, u"),
           optional_positive("arms.length", "u; twice workspace.radius + arms.radius if absent"),
           optional_positive(
               "arms.radius",
               "distance of the joints from the cell's axis, u; that of the workspace if absent"),
           positive_parameter("max_speed", 10.0, "greatest speed of each coordinate, u/s"),
           positive_parameter("max_acceleration", 200.0, "greatest acceleration of each coordinate, u/s²"),
           optional_positive("max_force",
                             "load at which the joints yield, mass·u/s²; if absent, unlimited, or stiffness "
                             "times workspace.radius"),
           optional_positive("stiffness", "of the tip's spring, mass/s²; rigid if absent"),
           optional_size("damping", "of the tip's damper, mass/s; 0.02 s times the stiffness if absent")})),
      .channels = [](const ActuatorSpec& s) -> std::vector<ActuatorChannel> {
        const double radius = s.number("workspace.radius");
        const auto& z = s.numbers("workspace.z");
        return {symmetric_channel("x", "u", radius),
                symmetric_channel("y", "u", radius),
                {"z", "u", z[0], z[1], std::clamp(0.0, z[0], z[1])}};
      },
      .height_limits =
          [](const ActuatorSpec& s) {
            return std::array{s.numbers("workspace.z")[0], s.numbers("workspace.z")[1]};
          },
      .disc_radius = [](const ActuatorSpec& s) { return s.number("workspace.radius"); },
      .check_constraints = check_delta};
}

}  // namespace

std::string check_tip_size(const ActuatorSpec& s) {
  if (s.model != "pin") return "";
  const double limit = std::min(s.numbers("top")[0], s.numbers("top")[1]) / 2.0;
  for (const char* parameter : {"tip.radius", "tip.corner_radius"})
    if (s.has(parameter) && s.number(parameter) > limit * (1.0 + 1e-9))
      return s.model + "." + parameter + " = " + format_number(s.number(parameter)) + ": must be in (0, " +
             format_number(limit) + "], half of the top's shorter edge";
  return "";
}

std::vector<ActuatorKind> built_in_actuators() {
  return {pin_kind(),         ball_kind(),   wheels_kind(),  conveyor_kind(), rotor_kind(),
          force_field_kind(), magnet_kind(), air_jet_kind(), tile_kind(),     delta_kind()};
}

}  // namespace smartsurf::scene
