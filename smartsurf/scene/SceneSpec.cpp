#include "smartsurf/scene/SceneSpec.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "smartsurf/scene/Axes.h"
#include "smartsurf/scene/BuiltInActuators.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/NarrowGap.h"

namespace smartsurf::scene {
namespace {

std::string range_error(const std::string& field, double value, const std::string& constraint) {
  return field + " = " + format_number(value) + ": must be " + constraint;
}

bool is_positive(double v) { return std::isfinite(v) && v > 0.0; }

// The limits keep squared lengths and moments of inertia within the range of single precision.
constexpr double kMaxMagnitude = 1e6, kMinSize = 1e-3, kMinMass = 1e-9;
constexpr double kMinInertia = 1e-15, kMaxInertia = 1e24;
constexpr double kMaxEffort = 1e12;

bool is_size(double v) { return v >= kMinSize && v <= kMaxMagnitude; }
bool is_coordinate(double v) { return std::abs(v) <= kMaxMagnitude; }

// Keeps the first constraint that does not hold, as the clause that validate() returns.
class Constraints {
 public:
  // `prefix` comes before the name of each field.
  explicit Constraints(std::string prefix = "") : prefix_(std::move(prefix)) {}

  Constraints& require(bool holds, std::string_view field, double value, const std::string& rule) {
    return holds ? *this : also(range_error(prefix_ + std::string(field), value, rule));
  }
  Constraints& in(std::string_view field, double value, double low, double high) {
    if (value >= low && value <= high) return *this;
    return require(false, field, value, "in [" + format_number(low) + ", " + format_number(high) + "]");
  }
  Constraints& size(std::string_view field, double value) {
    return in(field, value, kMinSize, kMaxMagnitude);
  }
  Constraints& effort(std::string_view field, double value) { return in(field, value, 0.0, kMaxEffort); }
  Constraints& coordinate(std::string_view field, double value) {
    return in(field, value, -kMaxMagnitude, kMaxMagnitude);
  }
  Constraints& vector(std::string_view field, const Eigen::Vector3d& v) {
    for (int i = 0; i < 3; ++i)
      if (!is_coordinate(v[i])) coordinate(std::string(field) + "[" + std::to_string(i + 1) + "]", v[i]);
    return *this;
  }
  // Adds the clause of another check, "" if that holds.
  Constraints& also(const std::string& clause) {
    if (broken_.empty()) broken_ = clause;
    return *this;
  }
  bool hold() const { return broken_.empty(); }
  const std::string& broken() const { return broken_; }

 private:
  std::string prefix_, broken_;
};

std::string validate(const PinSpec& pin, double pitch, const std::string& model) {
  const std::string top_rule = "in [0.001, pitch], the pitch is " + format_number(pitch);
  const bool is_pin = model == "pin";
  const std::string lowest = is_pin ? "pin.range[1]" : model + ", the least height of the tops",
                    highest = is_pin ? "pin.range[2]" : model + ", the greatest height of the tops";
  return Constraints()
      .require(is_size(pin.top_x) && pin.top_x <= pitch, model + ".top[1]", pin.top_x, top_rule)
      .require(is_size(pin.top_y) && pin.top_y <= pitch, model + ".top[2]", pin.top_y, top_rule)
      .size("pin.length", pin.length)
      .coordinate(lowest, pin.min_height)
      .coordinate(highest, pin.max_height)
      .require(pin.max_height >= pin.min_height, highest, pin.max_height,
               "not below " + lowest + " = " + format_number(pin.min_height))
      .require(is_positive(pin.max_speed), "pin.max_speed", pin.max_speed, "greater than 0")
      .require(is_positive(pin.max_acceleration), "pin.max_acceleration", pin.max_acceleration,
               "greater than 0")
      .broken();
}

std::string validate_actuators(const SurfaceSpec& s) {
  for (const ActuatorSpec& a : s.actuators) {
    const auto& top = a.numbers("top");
    if (top[0] != s.pin.top_x || top[1] != s.pin.top_y)
      return a.model + ".top: {" + format_number(top[0]) + ", " + format_number(top[1]) +
             "}: must be that of the surface's " + s.actuators[0].model + ", {" + format_number(s.pin.top_x) +
             ", " + format_number(s.pin.top_y) + "}: all cells are of one size";
    if (std::string p = check_tip_size(a); !p.empty()) return p;
  }
  for (std::size_t i = 0; i < s.cell_poses.size(); ++i)
    if (!is_coordinate(s.cell_poses[i].x) || !is_coordinate(s.cell_poses[i].y))
      return "surface.positions[" + std::to_string(i + 1) + "]: must be in [-1000000, 1000000]";
  for (std::size_t i = 0; i < s.base_heights.size(); ++i)
    if (!is_coordinate(static_cast<double>(s.base_heights[i])))
      return Constraints()
          .coordinate("surface.base of cell " + std::to_string(i + 1), static_cast<double>(s.base_heights[i]))
          .broken();
  return "";
}

// Checks the limits of the shared-memory protocol: channel count, name length and characters, unique names.
std::string validate_channel_names(const std::vector<std::string>& channels, std::size_t actuator_channels) {
  constexpr std::size_t kMaxChannels = 32;
  if (channels.size() + actuator_channels > kMaxChannels)
    return "surface.sensors: " + std::to_string(channels.size()) + " sensor channels beside " +
           std::to_string(actuator_channels) + " of actuators: must be at most " +
           std::to_string(kMaxChannels) + " together";
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (!is_channel_name(channels[i]))
      return "surface.sensors: channel '" + channels[i] + "': must be " + kChannelNameRule;
    if (std::count(channels.begin(), channels.end(), channels[i]) > 1)
      return "surface.sensors: two channels are called '" + channels[i] + "': give a sensor another name";
  }
  return "";
}

std::string validate_channels(const SurfaceSpec& s) {
  std::vector<std::string> sensors = s.sensor_channels();
  if (s.has_empty_cells()) {
    if (std::ranges::find(sensors, kOccupancyChannel) != sensors.end())
      return "surface.sensors: the name 'occupancy' is taken by the mask of a surface with empty cells";
    sensors.emplace_back(kOccupancyChannel);
  }
  return validate_channel_names(sensors, s.actuator_channels().size());
}

// The safe value that every actuator clamps to its own one; that of the first if there is none.
double common_safe_value(std::span<const ActuatorChannel> shared) {
  const auto is_common = [&](double value) {
    return std::ranges::all_of(shared, [value](const ActuatorChannel& c) {
      return std::clamp(value, c.minimum, c.maximum) == c.safe_value;
    });
  };
  const auto found = std::ranges::find_if(shared, is_common, &ActuatorChannel::safe_value);
  return (found == shared.end() ? shared.begin() : found)->safe_value;
}

}  // namespace

bool SurfaceSpec::has_empty_cells() const {
  return std::ranges::find(actuator_of_cell, kEmptyCell) != actuator_of_cell.end();
}

std::vector<float> SurfaceSpec::occupancy() const {
  std::vector<float> mask;
  if (!has_empty_cells()) return mask;
  for (const std::int8_t actuator : actuator_of_cell) mask.push_back(actuator == kEmptyCell ? 0.0F : 1.0F);
  return mask;
}

std::vector<SensorChannel> SurfaceSpec::observed_channels() const {
  std::vector<SensorChannel> channels = collect_channels(sensors);
  if (has_empty_cells()) channels.push_back({.name = kOccupancyChannel});
  return channels;
}

std::vector<std::string> SurfaceSpec::sensor_channels() const {
  std::vector<std::string> names;
  for (const SensorChannel& channel : collect_channels(sensors)) names.push_back(channel.name);
  return names;
}

std::optional<PhysicalUnit> find_physical_unit(std::string_view name) {
  const auto* const unit = std::ranges::find(kPhysicalUnits, name, &PhysicalUnit::name);
  return unit == std::end(kPhysicalUnits) ? std::nullopt : std::optional(*unit);
}

int WorldSpec::steps_per_tick() const {
  return std::max(1, static_cast<int>(std::lround(control_period_s / dt_s)));
}

double ObjectSpec::volume() const {
  switch (shape) {
    case ShapeKind::kSphere:
      return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
    case ShapeKind::kBox:
      return size.prod();
    case ShapeKind::kCylinder:
      return std::numbers::pi * radius * radius * height;
    case ShapeKind::kCapsule:
      return std::numbers::pi * radius * radius * (height - 2.0 / 3.0 * radius);
    case ShapeKind::kCone:
      return std::numbers::pi * radius * radius * height / 3.0;
    case ShapeKind::kSolid:
      return solid->volume;
  }
  return 0.0;
}

Eigen::Vector3d ObjectSpec::half_extents() const {
  switch (shape) {
    case ShapeKind::kSphere:
      return Eigen::Vector3d::Constant(radius);
    case ShapeKind::kBox:
      return size / 2.0;
    case ShapeKind::kCylinder:
    case ShapeKind::kCapsule:
      return {radius, radius, height / 2.0};
    case ShapeKind::kCone:
      return {radius, radius, 0.75 * height};
    case ShapeKind::kSolid:
      return solid->bounds_min.cwiseAbs().cwiseMax(solid->bounds_max.cwiseAbs()).cast<double>();
  }
  return Eigen::Vector3d::Zero();
}

CellPose hexagonal_pose(int row_from_south, int column, double pitch) {
  return {(column + 0.5 * (row_from_south % 2)) * pitch, row_from_south * pitch * std::numbers::sqrt3 / 2.0,
          0.0};
}

bool SurfaceSpec::has_hexagonal_tops() const {
  if (cell_poses.empty() || rows < 2 || actuators.empty()) return false;
  for (const ActuatorSpec& a : actuators)
    if (a.model == "pin" || a.model == "tile" || a.model == "delta") return false;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const CellPose &there = cell_poses[index(row, column)],
                     right = hexagonal_pose(rows - 1 - row, column, pitch);
      if (there.angle != 0.0 || std::hypot(there.x - right.x, there.y - right.y) > 1e-4 * pitch) return false;
    }
  return true;
}

bool SurfaceSpec::has_narrow_gaps() const {
  return cell_poses.empty() && pitch - std::min(pin.top_x, pin.top_y) <= kMaxNarrowGap * pitch;
}

ActuatorSpec make_pin_actuator(const PinSpec& pin) {
  ActuatorSpec spec = find_actuator_kind("pin")->default_spec();
  spec.values["top"] = {pin.top_x, pin.top_y};
  spec.values["length"] = {pin.length};
  spec.values["range"] = {pin.min_height, pin.max_height};
  spec.values["max_speed"] = {pin.max_speed};
  spec.values["max_acceleration"] = {pin.max_acceleration};
  return spec;
}

void derive_pin_spec(SurfaceSpec& s) {
  s.actuators = s.effective_actuators();
  double low = 0.0, high = 0.0;
  for (std::size_t i = 0; i < s.actuators.size(); ++i) {
    const ActuatorSpec& a = s.actuators[i];
    const auto heights = find_actuator_kind(a.model)->height_limits_of(a);
    low = i == 0 ? heights[0] : std::min(low, heights[0]);
    high = i == 0 ? heights[1] : std::max(high, heights[1]);
    if (i == 0) s.pin.top_x = a.numbers("top")[0], s.pin.top_y = a.numbers("top")[1];
    s.pin.length = i == 0 ? a.number("length") : std::max(s.pin.length, a.number("length"));
  }
  for (const ActuatorSpec& a : s.actuators) {
    if (a.model != "pin") continue;
    s.pin.max_speed = a.number("max_speed");
    s.pin.max_acceleration = a.number("max_acceleration");
    break;
  }
  const auto [lowest, highest] =
      std::ranges::minmax(s.base_heights.empty() ? std::vector<float>{0.0F} : s.base_heights);
  s.pin.min_height = low + static_cast<double>(lowest);
  s.pin.max_height = high + static_cast<double>(highest);
}

Eigen::AlignedBox2d SurfaceSpec::skin_extent() const {
  const double first = (border_height ? 1 : 0) * pitch;
  const auto last = [&](int count) { return (count - 1) * pitch - first; };
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(skin->margin);
  return {Eigen::Vector2d(first, first) - margin, Eigen::Vector2d(last(columns), last(rows)) + margin};
}

std::vector<ActuatorSpec> SurfaceSpec::effective_actuators() const {
  return actuators.empty() ? std::vector<ActuatorSpec>{make_pin_actuator(pin)} : actuators;
}

std::vector<Extension> SurfaceSpec::extensions() const {
  std::vector<Extension> all;
  const auto add = [&all](const auto* kind) {
    if (kind == nullptr || kind->extension.name.empty()) return;
    if (std::ranges::find(all, kind->extension) == all.end()) all.push_back(kind->extension);
  };
  for (const ActuatorSpec& actuator : effective_actuators()) add(find_actuator_kind(actuator.model));
  for (const SensorSpec& sensor : sensors) add(find_sensor_kind(sensor.model));
  return all;
}

std::vector<ActuatorChannel> SurfaceSpec::actuator_channels() const {
  std::vector<ActuatorChannel> all;
  std::vector<std::vector<ActuatorChannel>> shared;  // by channel, as in `all`: those of the actuators
  for (const ActuatorSpec& actuator : effective_actuators())
    for (const ActuatorChannel& channel : find_actuator_kind(actuator.model)->channels(actuator)) {
      const auto same = std::ranges::find(all, channel.name, &ActuatorChannel::name);
      if (same == all.end()) {
        all.push_back(channel);
        shared.push_back({channel});
        continue;
      }
      same->minimum = std::min(same->minimum, channel.minimum);
      same->maximum = std::max(same->maximum, channel.maximum);
      shared[same - all.begin()].push_back(channel);
    }
  for (std::size_t i = 0; i < all.size(); ++i) all[i].safe_value = common_safe_value(shared[i]);
  return all;
}

Eigen::Matrix3d ObjectSpec::homogeneous_inertia(double of_mass) const {
  const double r2 = radius * radius, h2 = height * height;
  Eigen::Vector3d per_mass = Eigen::Vector3d::Constant(0.4 * r2);
  switch (shape) {
    case ShapeKind::kSphere:
      break;
    case ShapeKind::kBox: {
      const Eigen::Vector3d s = size.cwiseAbs2();
      per_mass = Eigen::Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y()) / 12.0;
      break;
    }
    case ShapeKind::kCylinder:
      per_mass = {(3.0 * r2 + h2) / 12.0, (3.0 * r2 + h2) / 12.0, 0.5 * r2};
      break;
    case ShapeKind::kCapsule: {
      // A cylinder of length l and two hemispheres, weighted by volume.
      const double l = std::max(0.0, height - 2.0 * radius), ball = 4.0 / 3.0 * radius;
      const double tube = l / (l + ball), caps = ball / (l + ball);
      const double across =
          tube * (3.0 * r2 + l * l) / 12.0 + caps * (0.4 * r2 + 0.25 * l * l + 0.375 * l * radius);
      per_mass = {across, across, tube * 0.5 * r2 + caps * 0.4 * r2};
      break;
    }
    case ShapeKind::kCone:
      per_mass = {0.15 * r2 + 0.0375 * h2, 0.15 * r2 + 0.0375 * h2, 0.3 * r2};
      break;
    case ShapeKind::kSolid:
      return solid->inertia * (of_mass / solid->volume);
  }
  return (per_mass * of_mass).asDiagonal();
}

std::string validate(const WorldSpec& w) {
  if (std::ranges::find(kEngineNames, w.engine) == std::end(kEngineNames))
    return "world.engine = '" + w.engine + "': must be 'native' or 'bullet'";
  const double steps = w.control_period_s / w.dt_s;
  return Constraints("world.")
      .vector("gravity", w.gravity)
      .require(w.dt_s >= 1e-5 && w.dt_s <= 0.1, "dt", w.dt_s, "in [1e-05, 0.1] seconds")
      .require(w.iterations >= 1 && w.iterations <= 1000, "iterations", w.iterations, "1 to 1000")
      .require(is_positive(w.control_period_s) && w.control_period_s <= 10.0, "control_period",
               w.control_period_s, "in (0, 10] seconds")
      .require(std::abs(steps - std::round(steps)) <= 1e-6 * steps && std::round(steps) >= 1.0,
               "control_period", w.control_period_s,
               "an integer number of physics steps, world.dt = " + format_number(w.dt_s))
      .broken();
}

std::string validate(const Material& m) {
  if (m.name.empty()) return "material.name is missing";
  return Constraints("material.")
      .in("friction", m.friction, 0.0, kMaxMagnitude)
      .in("rolling_friction", m.rolling_friction, 0.0, kMaxMagnitude)
      .in("restitution", m.restitution, 0.0, 1.0)
      .in("density", m.density, kMinMass, kMaxMagnitude)
      .broken();
}

namespace {

// True if a skin can lie over the actuator: its top does not drive what lies on it, and bears any load.
bool can_hold_skin(const ActuatorSpec& a) {
  if (a.model == "pin") return !a.has("max_force") && !a.has("stiffness");
  if (a.model == "delta") return !a.has("stiffness") && !a.has("max_force");
  return a.model == "tile" && a.number("command") == 1.0;  // a pose
}

std::string validate_skin(const SurfaceSpec& s) {
  constexpr int kMaxNodes = 512;
  if (!s.skin) return "";
  const SkinSpec& k = *s.skin;
  if (!s.cell_poses.empty())
    return "surface.skin: needs the rectangular layout: without layout, positions or module gaps";
  for (const ActuatorSpec& a : s.effective_actuators())
    if (!can_hold_skin(a))
      return "surface.skin: over '" + a.model +
             "': must be over tiles of the command 'pose', pins or deltas, without max_force and stiffness";
  if (!(k.margin >= 0.0 && k.margin <= s.pitch))
    return range_error("surface.skin.margin", k.margin, "in [0, " + format_number(s.pitch) + "], the pitch");
  const int border = s.border_height ? 2 : 0;
  bool any = false;
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) any |= s.is_under_skin(r, c) && !s.is_empty(r, c);
  if (!any) return "surface.skin: there is no actuator under it";
  for (const auto& [nodes, cells, axis] :
       {std::tuple(k.rows, s.rows - border, 1), {k.columns, s.columns - border, 2}}) {
    const double extent = (cells - 1) * s.pitch + 2.0 * k.margin;
    const int least = std::max(2, static_cast<int>(std::ceil(2.0 * extent / s.pitch - 1e-9)) + 1);
    if (nodes < least || nodes > kMaxNodes)
      return range_error("surface.skin.nodes[" + std::to_string(axis) + "]", nodes,
                         std::to_string(least) + " to " + std::to_string(kMaxNodes) + ", two for each pitch");
    if (!is_size(extent))
      return range_error("surface.skin.margin", k.margin, "greater than 0 over a single cell");
  }
  return Constraints("surface.skin.")
      .require(is_positive(k.tension) && k.tension <= kMaxMagnitude, "tension", k.tension, "in (0, 1000000]")
      .in("density", k.density, kMinMass, kMaxMagnitude)
      .in("damping", k.damping, 0.0, kMaxMagnitude)
      .coordinate("edge.height", k.edge_height)
      .broken();
}

}  // namespace

std::string validate(const SurfaceSpec& s) {
  Constraints all;
  all.require(s.rows >= 1 && s.rows <= 4096, "surface.rows", s.rows, "1 to 4096")
      .require(s.columns >= 1 && s.columns <= 4096, "surface.columns", s.columns, "1 to 4096")
      .size("surface.pitch", s.pitch)
      .also(validate(s.pin, s.pitch, s.actuators.empty() ? "pin" : s.actuators[0].model));
  if (!all.hold()) return all.broken();
  all.also(validate_actuators(s));
  for (const auto& sensor : s.sensors) all.also(find_sensor_kind(sensor.model)->validate(sensor));
  if (!all.hold()) return all.broken();
  all.also(validate_channels(s));
  if (s.border_height) all.coordinate("border.height", *s.border_height);
  if (!all.hold()) return all.broken();
  return validate_skin(s);
}

// The inertia of a body is positive, and no principal moment exceeds the sum of the others by more than 1 %.
std::string validate_inertia(const Eigen::Matrix3d& inertia) {
  if (!inertia.allFinite()) return "inertia: must be finite";
  const Eigen::Vector3d moments = principal_axes(inertia).moments;
  if (!(moments[0] >= kMinInertia && moments[2] <= kMaxInertia))
    return range_error("inertia, whose least principal moment", moments[0],
                       "in [1e-15, 1e+24], as must the greatest, " + format_number(moments[2]));
  constexpr double kTolerance = 1.01;
  if (moments[2] > kTolerance * (moments[0] + moments[1]))
    return range_error("inertia, whose greatest principal moment", moments[2],
                       "at most the sum of the others, " + format_number(moments[0] + moments[1]));
  return "";
}

std::string validate(const ObjectSpec& o) {
  Constraints all;
  if (o.shape == ShapeKind::kBox) {
    for (int i = 0; i < 3; ++i)
      if (!is_size(o.size[i])) all.size("size[" + std::to_string(i + 1) + "]", o.size[i]);
  } else if (o.shape == ShapeKind::kSolid) {
    if (!o.solid) return "solid: is missing";
  } else {
    all.size("radius", o.radius);
    if (o.shape != ShapeKind::kSphere) all.size("height", o.height);
    if (o.shape == ShapeKind::kCapsule && o.height < 2.0 * o.radius)
      all.require(false, "height", o.height, "at least twice the radius, " + format_number(2.0 * o.radius));
  }
  all.vector("position", o.position)
      .vector("velocity", o.velocity)
      .vector("angular_velocity", o.angular_velocity)
      .vector("com", o.centre_of_mass);
  if (o.inertia) all.also(validate_inertia(*o.inertia));
  all.coordinate("pole", o.magnetic_pole).vector("moment", o.magnetic_moment);
  if (!o.orientation.coeffs().allFinite() || o.orientation.norm() < 1e-6)
    all.also("orientation: must be a rotation");
  if (o.mass) all.in("mass", *o.mass, kMinMass, 1e12);
  if (o.friction) all.in("friction", *o.friction, 0.0, kMaxMagnitude);
  return all.broken();
}

std::string validate(const JointSpec& j) {
  if (j.b && *j.b == j.a) return "b = " + std::to_string(j.a) + ": must be another object than a";
  Constraints all;
  all.vector("anchor", j.anchor).vector("axis", j.axis);
  if (j.axis.norm() < 1e-6) all.also("axis: must not be zero");
  for (const auto& [field, present] :
       {std::pair{"limits", j.limits.has_value()}, std::pair{"friction", j.friction != 0.0},
        std::pair{"spring", j.spring.has_value()}, std::pair{"motor", j.motor.has_value()}})
    if (present && !j.has_coordinate())
      all.also(std::string(field) + ": a " + kJointKindNames[static_cast<int>(j.kind)] +
               " joint has none; only hinge and slider do");
  if (j.limits)
    all.coordinate("limits[1]", j.limits->lower)
        .coordinate("limits[2]", j.limits->upper)
        .require(j.limits->upper >= j.limits->lower, "limits[2]", j.limits->upper,
                 "not below limits[1] = " + format_number(j.limits->lower));
  all.effort("friction", j.friction);
  if (j.spring)
    all.effort("spring.stiffness", j.spring->stiffness)
        .effort("spring.damping", j.spring->damping)
        .coordinate("spring.rest", j.spring->rest);
  if (j.motor)
    all.coordinate("motor.speed", j.motor->speed)
        .effort(j.kind == JointKind::kHinge ? "motor.max_torque" : "motor.max_force", j.motor->max_effort);
  return all.broken();
}

}  // namespace smartsurf::scene
