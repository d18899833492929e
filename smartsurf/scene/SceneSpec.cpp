#include "smartsurf/scene/SceneSpec.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <numbers>
#include <numeric>
#include <sstream>

#include "smartsurf/scene/Occupancy.h"

namespace smartsurf::scene {
namespace {

// Insertions, deletions, substitutions and swaps of two neighbours (optimal string alignment).
int edit_distance(const std::string& a, const std::string& b) {
  std::vector<int> before(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
  std::iota(above.begin(), above.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    std::swap(before, above);
    std::swap(above, row);
  }
  return above[b.size()];
}

std::string clause(const std::string& field, double value, const std::string& rule) {
  return field + " = " + text_of(value) + ": must be " + rule;
}

bool positive(double v) { return std::isfinite(v) && v > 0.0; }
bool not_negative(double v) { return std::isfinite(v) && v >= 0.0; }

// The physics may compute in single precision, where a length squared or a mass times a length squared must
// neither overflow nor vanish.
constexpr double kLargest = 1e6, kSmallestSize = 1e-3, kSmallestMass = 1e-9;

bool is_size(double v) { return v >= kSmallestSize && v <= kLargest; }
bool is_coordinate(double v) { return std::abs(v) <= kLargest; }
constexpr const char* kSizeRule = "in [0.001, 1000000]";
constexpr const char* kCoordinateRule = "in [-1000000, 1000000]";

std::string problem_with_vector(const std::string& field, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i)
    if (!is_coordinate(v[i])) return clause(field + "[" + std::to_string(i + 1) + "]", v[i], kCoordinateRule);
  return "";
}

std::string problem_with(const PinSpec& pin, double pitch, const std::string& model) {
  if (!is_size(pin.top_x) || pin.top_x > pitch)
    return clause(model + ".top[1]", pin.top_x, "in [0.001, pitch], the pitch is " + text_of(pitch));
  if (!is_size(pin.top_y) || pin.top_y > pitch)
    return clause(model + ".top[2]", pin.top_y, "in [0.001, pitch], the pitch is " + text_of(pitch));
  if (!is_size(pin.length)) return clause("pin.length", pin.length, kSizeRule);
  if (!is_coordinate(pin.min_height)) return clause("pin.range[1]", pin.min_height, kCoordinateRule);
  if (!is_coordinate(pin.max_height)) return clause("pin.range[2]", pin.max_height, kCoordinateRule);
  if (pin.max_height < pin.min_height)
    return clause("pin.range[2]", pin.max_height, "not below pin.range[1] = " + text_of(pin.min_height));
  if (!positive(pin.max_speed)) return clause("pin.max_speed", pin.max_speed, "greater than 0");
  if (!positive(pin.max_acceleration))
    return clause("pin.max_acceleration", pin.max_acceleration, "greater than 0");
  return "";
}

std::string problem_with_actuators(const SurfaceSpec& s) {
  for (const ActuatorSpec& a : s.actuators) {
    const auto& top = a.numbers("top");
    if (top[0] != s.pin.top_x || top[1] != s.pin.top_y)
      return a.model + ".top: {" + text_of(top[0]) + ", " + text_of(top[1]) +
             "}: must be that of the surface's " + s.actuators[0].model + ", {" + text_of(s.pin.top_x) +
             ", " + text_of(s.pin.top_y) + "}: all cells are of one size";
  }
  for (std::size_t i = 0; i < s.places.size(); ++i)
    if (!is_coordinate(s.places[i].x) || !is_coordinate(s.places[i].y))
      return "surface.positions[" + std::to_string(i + 1) + "]: must be " + kCoordinateRule;
  for (std::size_t i = 0; i < s.base.size(); ++i)
    if (!is_coordinate(static_cast<double>(s.base[i])))
      return clause("surface.base of cell " + std::to_string(i + 1), static_cast<double>(s.base[i]),
                    kCoordinateRule);
  return "";
}

// The channels must fit into the shared-memory protocol: names of at most 31 plain characters, all different.
std::string problem_with_names(const std::vector<std::string>& channels, std::size_t actuator_channels) {
  constexpr std::size_t kMostChannels = 32;
  static const std::string kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-";
  if (channels.size() + actuator_channels > kMostChannels)
    return "surface.sensors: " + std::to_string(channels.size()) + " sensor channels beside " +
           std::to_string(actuator_channels) + " of actuators: must be at most " +
           std::to_string(kMostChannels) + " together";
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (channels[i].empty() || channels[i].size() > 31 ||
        channels[i].find_first_not_of(kPlain) != std::string::npos)
      return "surface.sensors: channel '" + channels[i] +
             "': must be 1 to 31 letters, digits, '_', '.' and '-'";
    if (std::count(channels.begin(), channels.end(), channels[i]) > 1)
      return "surface.sensors: two channels are called '" + channels[i] + "': give a sensor another name";
  }
  return "";
}

std::string problem_with_channels(const SurfaceSpec& s) {
  std::vector<std::string> sensors = s.sensor_channels();
  if (has_empty_cells(s)) {
    if (std::ranges::find(sensors, kOccupancy) != sensors.end())
      return "surface.sensors: the name 'occupancy' is taken by the mask of a surface with empty cells";
    sensors.emplace_back(kOccupancy);
  }
  return problem_with_names(sensors, s.actuator_channels().size());
}

}  // namespace

std::vector<std::string> SurfaceSpec::sensor_channels() const {
  std::vector<std::string> names;
  for (const SensorChannel& channel : channels_of(sensors)) names.push_back(channel.name);
  return names;
}

std::string text_of(double value) {
  if (std::isnan(value)) return "nan";  // without a sign
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(12);
  out << value;
  return out.str();
}

std::string nearest_name(const std::string& word, const std::vector<std::string>& known) {
  const int limit = std::max(1, static_cast<int>(word.size()) / 3);
  std::string best;
  int best_distance = limit + 1;
  for (const auto& name : known) {
    const int d = edit_distance(word, name);
    if (d < best_distance) best_distance = d, best = name;
  }
  return best;
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
      return solid->low.cwiseAbs().cwiseMax(solid->high.cwiseAbs()).cast<double>();
  }
  return Eigen::Vector3d::Zero();
}

ActuatorSpec pin_actuator(const PinSpec& pin) {
  ActuatorSpec spec = find_actuator_kind("pin")->standard();
  spec.values["top"] = {pin.top_x, pin.top_y};
  spec.values["length"] = {pin.length};
  spec.values["range"] = {pin.min_height, pin.max_height};
  spec.values["max_speed"] = {pin.max_speed};
  spec.values["max_acceleration"] = {pin.max_acceleration};
  return spec;
}

void fit_body(SurfaceSpec& s) {
  const PinSpec usual = s.pin;
  double low = usual.min_height, high = usual.max_height;
  for (std::size_t i = 0; i < s.actuators.size(); ++i) {
    const ActuatorSpec& a = s.actuators[i];
    const auto heights = find_actuator_kind(a.model)->heights_of(a);
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
  const auto [lowest, highest] = std::ranges::minmax(s.base.empty() ? std::vector<float>{0.0F} : s.base);
  s.pin.min_height = low + static_cast<double>(lowest);
  s.pin.max_height = high + static_cast<double>(highest);
}

std::vector<ActuatorSpec> SurfaceSpec::mechanisms() const {
  return actuators.empty() ? std::vector<ActuatorSpec>{pin_actuator(pin)} : actuators;
}

std::vector<ActuatorChannel> SurfaceSpec::actuator_channels() const {
  std::vector<ActuatorChannel> all;
  for (const ActuatorSpec& actuator : mechanisms())
    for (const ActuatorChannel& channel : find_actuator_kind(actuator.model)->channels(actuator)) {
      const auto same = std::ranges::find(all, channel.name, &ActuatorChannel::name);
      if (same == all.end()) {
        all.push_back(channel);
        continue;
      }
      same->minimum = std::min(same->minimum, channel.minimum);
      same->maximum = std::max(same->maximum, channel.maximum);
    }
  return all;
}

std::string problem_with(const WorldSpec& w) {
  if (auto p = problem_with_vector("world.gravity", w.gravity); !p.empty()) return p;
  if (!(w.dt_s >= 1e-5 && w.dt_s <= 0.1)) return clause("world.dt", w.dt_s, "in [1e-05, 0.1] seconds");
  if (w.iterations < 1 || w.iterations > 1000) return clause("world.iterations", w.iterations, "1 to 1000");
  if (!positive(w.control_period_s) || w.control_period_s > 10.0)
    return clause("world.control_period", w.control_period_s, "in (0, 10] seconds");
  const double steps = w.control_period_s / w.dt_s;
  if (std::abs(steps - std::round(steps)) > 1e-6 * steps || std::round(steps) < 1.0)
    return clause("world.control_period", w.control_period_s,
                  "an integer number of physics steps, world.dt = " + text_of(w.dt_s));
  return "";
}

std::string problem_with(const Material& m) {
  if (m.name.empty()) return "material.name is missing";
  if (!not_negative(m.friction) || m.friction > kLargest)
    return clause("material.friction", m.friction, "in [0, 1000000]");
  if (!not_negative(m.rolling_friction) || m.rolling_friction > kLargest)
    return clause("material.rolling_friction", m.rolling_friction, "in [0, 1000000]");
  if (!not_negative(m.restitution) || m.restitution > 1.0)
    return clause("material.restitution", m.restitution, "in [0, 1]");
  if (!positive(m.density) || m.density > kLargest || m.density < kSmallestMass)
    return clause("material.density", m.density, "in [1e-09, 1000000]");
  return "";
}

std::string problem_with(const SurfaceSpec& s) {
  if (s.rows < 1 || s.rows > 4096) return clause("surface.rows", s.rows, "1 to 4096");
  if (s.columns < 1 || s.columns > 4096) return clause("surface.columns", s.columns, "1 to 4096");
  if (!is_size(s.pitch)) return clause("surface.pitch", s.pitch, kSizeRule);
  if (auto p = problem_with(s.pin, s.pitch, s.actuators.empty() ? "pin" : s.actuators[0].model); !p.empty())
    return p;
  if (auto p = problem_with_actuators(s); !p.empty()) return p;
  for (const auto& sensor : s.sensors)
    if (auto p = find_sensor_kind(sensor.model)->problem_with(sensor); !p.empty()) return p;
  if (auto p = problem_with_channels(s); !p.empty()) return p;
  if (s.border_height && !is_coordinate(*s.border_height))
    return clause("border.height", *s.border_height, kCoordinateRule);
  return "";
}

std::string problem_with(const ObjectSpec& o) {
  const bool round = o.shape != ShapeKind::kBox && o.shape != ShapeKind::kSolid;
  if (round && !is_size(o.radius)) return clause("radius", o.radius, kSizeRule);
  if (round && o.shape != ShapeKind::kSphere && !is_size(o.height))
    return clause("height", o.height, kSizeRule);
  if (o.shape == ShapeKind::kCapsule && o.height < 2.0 * o.radius)
    return clause("height", o.height, "at least twice the radius, " + text_of(2.0 * o.radius));
  if (o.shape == ShapeKind::kBox)
    for (int i = 0; i < 3; ++i)
      if (!is_size(o.size[i])) return clause("size[" + std::to_string(i + 1) + "]", o.size[i], kSizeRule);
  if (o.shape == ShapeKind::kSolid && !o.solid) return "solid: is missing";
  if (auto p = problem_with_vector("position", o.position); !p.empty()) return p;
  if (auto p = problem_with_vector("velocity", o.velocity); !p.empty()) return p;
  if (auto p = problem_with_vector("angular_velocity", o.angular_velocity); !p.empty()) return p;
  if (!is_coordinate(o.pole)) return clause("pole", o.pole, kCoordinateRule);
  if (auto p = problem_with_vector("moment", o.moment); !p.empty()) return p;
  if (!o.orientation.coeffs().allFinite() || o.orientation.norm() < 1e-6)
    return "orientation: must be a rotation";
  if (o.mass && !(*o.mass >= kSmallestMass && *o.mass <= 1e12))
    return clause("mass", *o.mass, "in [1e-09, 1e+12]");
  return "";
}

}  // namespace smartsurf::scene
