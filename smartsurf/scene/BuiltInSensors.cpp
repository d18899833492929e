#include "smartsurf/scene/BuiltInSensors.h"

#include <numbers>

namespace smartsurf::scene {
namespace {

using Type = Parameter::Type;

constexpr double kMaxForce = 1e6;        // mass·u/s², the default range of pressure sensors
constexpr double kMaxObjectTypes = 1e6;  // the maximum number of objects
constexpr int kMaxPixelsPerEdge = 4;     // 3 colours of 4 × 4 pixels fit into 64 components

SensorKind proximity_kind() {
  return {.name = "proximity",
          .parameters = ray_parameters(8.0),
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            const double range = s.number("range");
            const Eigen::Vector3d o = s.vector("origin"), d = s.vector("direction").normalized();
            return {{.name = s.name,
                     .unit = "u",
                     .maximum = range,
                     .no_detection = range,
                     .origin = {{o.x(), o.y(), o.z()}},
                     .direction = {{d.x(), d.y(), d.z()}}},
                    {.name = s.name + "_hit", .maximum = 1.0, .is_exact = true}};
          },
          .mask_channel = 1,
          .check_constraints = validate_ray};
}

SensorKind colour_kind() {
  return {.name = "colour",
          .parameters = ray_parameters(8.0),
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{.name = s.name, .components = 3}};
          },
          .check_constraints = validate_ray};
}

SensorKind object_type_kind() {
  return {.name = "object_type",
          .parameters = ray_parameters(8.0),
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{.name = s.name,
                     .maximum = kMaxObjectTypes,
                     .type = SensorChannel::Type::kUint32,
                     .is_exact = true}};
          },
          .check_constraints = validate_ray};
}

SensorKind light_kind() {
  SensorKind kind{.name = "light", .parameters = ray_parameters(1000.0)};
  kind.parameters.push_back({.name = "size",
                             .description = "angular radius of the light, rad; 0 = a point light",
                             .default_value = {0.0},
                             .maximum = std::numbers::pi / 4});
  kind.parameters.push_back({.name = "samples",
                             .description = "rays per cell towards a light with a size",
                             .type = Type::kCount,
                             .default_value = {16.0},
                             .minimum = 1.0,
                             .maximum = 256.0});
  kind.channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
    return {{.name = s.name, .maximum = 1.0, .no_detection = 1.0}};
  };
  kind.check_constraints = [](const SensorSpec& s) -> std::string {
    if (std::string p = validate_ray(s); !p.empty()) return p;
    return s.vector("direction").z() > 0.0
               ? ""
               : "direction: must point up, to the light: its third number must be > 0";
  };
  return kind;
}

SensorKind pressure_kind() {
  return {.name = "pressure",
          .parameters = {{.name = "range",
                          .description = "maximum force of the readings, mass·u/s²",
                          .default_value = {kMaxForce},
                          .maximum = 1e12,
                          .exclusive_minimum = true}},
          .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{s.name, "mass*u/s^2", 0.0, s.number("range"), 0.0}};
          }};
}

SensorKind camera_kind() {
  SensorKind kind{.name = "camera"};
  kind.parameters = {{.name = "resolution",
                      .description = "pixels along the edge of a cell",
                      .type = Type::kCount,
                      .default_value = {1.0},
                      .minimum = 1.0,
                      .maximum = kMaxPixelsPerEdge},
                     {.name = "height",
                      .description = "z of the camera, which looks down, u; objects above it are invisible",
                      .default_value = {100.0},
                      .minimum = -1e6},
                     {.name = "floor",
                      .description = "z of the background below the pins, u; read where nothing is seen",
                      .default_value = {-2.0},
                      .minimum = -1e6}};
  kind.channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
    const int pixels = static_cast<int>(s.number("resolution") * s.number("resolution"));
    const double floor = s.number("floor");
    return {{.name = s.name, .components = 3 * pixels},
            {s.name + "_height", "u", floor, s.number("height"), floor, pixels}};
  };
  kind.check_constraints = [](const SensorSpec& s) -> std::string {
    if (s.number("floor") < s.number("height")) return "";
    return "floor = " + format_number(s.number("floor")) + ": must be below the height, " +
           format_number(s.number("height"));
  };
  return kind;
}

// A channel with a component for each axis or joint, within ± the parameter `range`.
SensorKind signed_vector_kind(std::string name, std::string unit, double range, std::string description) {
  return {.name = std::move(name),
          .parameters = {{.name = "range",
                          .description = std::move(description),
                          .default_value = {range},
                          .maximum = 1e12,
                          .exclusive_minimum = true}},
          .channels = [unit = std::move(unit)](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{s.name, unit, -s.number("range"), s.number("range"), 0.0, 3}};
          }};
}

SensorKind pin_height_kind() {
  return {.name = "pin_height", .channels = [](const SensorSpec& s) -> std::vector<SensorChannel> {
            return {{s.name, "u", -1e6, 1e6}};
          }};
}

SensorKind joint_position_kind() {
  return signed_vector_kind("joint_position", "u", 1e6, "greatest size of the readings, u");
}

SensorKind tip_force_kind() {
  return signed_vector_kind("tip_force", "mass*u/s^2", kMaxForce,
                            "greatest size of each component, mass·u/s²");
}

// A channel with n × n samples in each cell, n being the parameter `resolution`.
SensorKind skin_kind(std::string name, std::string unit, double minimum, double maximum) {
  SensorKind kind{.name = std::move(name)};
  kind.parameters = {{.name = "resolution",
                      .description = "samples of the skin along the edge of a cell",
                      .type = Type::kCount,
                      .default_value = {1.0},
                      .minimum = 1.0,
                      .maximum = 8.0}};
  kind.channels = [=, unit = std::move(unit)](const SensorSpec& s) -> std::vector<SensorChannel> {
    const int samples = static_cast<int>(s.number("resolution") * s.number("resolution"));
    return {{s.name, unit, minimum, maximum, 0.0, samples}};
  };
  return kind;
}

}  // namespace

std::vector<SensorKind> built_in_sensors() {
  return {proximity_kind(),
          colour_kind(),
          object_type_kind(),
          light_kind(),
          pressure_kind(),
          camera_kind(),
          pin_height_kind(),
          joint_position_kind(),
          tip_force_kind(),
          skin_kind("skin_height", "u", -1e6, 1e6),
          skin_kind("skin_strain", "", 0.0, 1e6),
          skin_kind("skin_contact", "mass*u/s^2", 0.0, kMaxForce)};
}

}  // namespace smartsurf::scene
