// The immutable description of one experiment: plain values that every other room reads and none changes.
//
// Units: lengths in the experiment's arbitrary unit "u", time in seconds, angles in radians, masses in
// density·u³. x points east, y north, z up; the origin is the centre of the south-west cell with its pin
// fully down. Cell (row r, column c), row 0 at the north, stands at x = c·pitch, y = (rows − 1 − r)·pitch.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::scene {

// A user's mistake: what() is one whole line (file:line: what is wrong, the value, what would be right).
// main() prints it and exits with status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The nearest of `known` to `word` by edit distance, or "" when nothing is near enough to suggest.
std::string nearest_name(const std::string& word, const std::vector<std::string>& known);

struct Colour {
  float r = 0.93f, g = 0.62f, b = 0.22f;  // [0, 1], as a screen shows them (sRGB); amber, seen on any surface
};

// Two materials in contact combine as the geometric mean of their frictions and the larger of their
// restitutions.
struct Material {
  std::string name = "default";
  double friction = 0.5;           // Coulomb coefficient, ≥ 0
  double rolling_friction = 0.01;  // lever arm of the rolling resistance, u, ≥ 0
  double restitution = 0.2;        // [0, 1]
  double density = 1.0;            // mass per u³, > 0
};

enum class OffTable { kKeep, kRemove };

struct WorldSpec {
  Eigen::Vector3d gravity{0.0, 0.0, -9.81};  // u/s²
  double dt_s = 1.0 / 240.0;                 // one fixed physics step
  int iterations = 10;                       // of the constraint solver, per step
  double control_period_s = 1.0 / 60.0;      // an integer number of physics steps
  std::uint64_t seed = 1;
  bool ground = true;  // an endless floor under the table, that catches what falls off
  OffTable off_table = OffTable::kKeep;  // what becomes of objects that leave the table

  // Physics steps in one control period (≥ 1).
  int steps_per_tick() const;
};

// Capsules, cylinders and cones stand along their own z axis, a cone with its tip up. kSolid: a convex hull, or a mesh
// in convex pieces.
enum class ShapeKind { kSphere, kBox, kCylinder, kCapsule, kCone, kSolid };
inline constexpr int kShapeKinds = 6;

struct ObjectSpec {
  ShapeKind shape = ShapeKind::kSphere;
  double radius = 1.0;                      // sphere, cylinder, capsule, cone (of its base)
  double height = 1.0;                      // cylinder, capsule (caps included), cone
  Eigen::Vector3d size{1.0, 1.0, 1.0};      // box: full edge lengths
  std::shared_ptr<const Solid> solid;       // kSolid; never changed, shared between objects
  Eigen::Vector3d position{0.0, 0.0, 0.0};  // centre of mass
  Eigen::Quaterniond orientation{1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d velocity{0.0, 0.0, 0.0};
  Eigen::Vector3d angular_velocity{0.0, 0.0, 0.0};
  std::optional<double> mass;  // instead of the material's density
  bool fixed = false;          // never moves
  int material = 0;            // index into SceneSpec::materials
  Colour colour;
  std::string label;

  double volume() const;
  // Half extents of the box about the centre of mass, in the object's own frame, that encloses the shape.
  Eigen::Vector3d half_extents() const;
};

// One cell of the surface: a rectangular pin with one degree of freedom, moving up and down.
struct PinSpec {
  double top_x = 0.8, top_y = 0.8;  // edges of the pin's top, ≤ pitch
  double length = 2.0;
  double min_height = 0.0, max_height = 6.0;  // z of the top; commands are clamped to it
  double max_speed = 20.0;                    // u/s
  double max_acceleration = 400.0;            // u/s²
};

enum class SensorKind { kProximity };

// A sensor has two channels: NAME, its distances, and NAME_hit, 1 where something is within the range.
struct SensorSpec {
  SensorKind kind = SensorKind::kProximity;
  std::string name = "proximity";
  double range = 8.0;  // of the segment, straight up from the pin's top
};

struct SurfaceSpec {
  int rows = 64, columns = 64;
  double pitch = 1.0;
  PinSpec pin;
  std::vector<SensorSpec> sensors;
  std::optional<double> border_height;  // the outermost ring of cells is held at this height
  int material = 0;

  int cells() const { return rows * columns; }
  // Names of the sensor channels: two a sensor, in the order of the sensors.
  std::vector<std::string> sensor_channels() const;
  int index(int row, int column) const { return row * columns + column; }
  bool is_border(int row, int column) const {
    return row == 0 || column == 0 || row == rows - 1 || column == columns - 1;
  }
  Eigen::Vector2d centre(int row, int column) const { return {column * pitch, (rows - 1 - row) * pitch}; }
};

struct RecordSpec {
  bool objects = true, sensors = false, actuators = false;
  int every = 1;  // control periods between two recorded frames
};

// One name that the script made an option: listed by --help, changed by --set name=value.
struct OptionSpec {
  std::string name;
  std::string value;  // as text: the default, or what --set gave
  std::string help;
};

struct SceneSpec {
  std::string file;  // the experiment's path, as the user gave it
  std::string text;  // its source, for the recording
  WorldSpec world;
  std::vector<Material> materials{Material{}};  // [0] is "default"
  SurfaceSpec surface;
  std::vector<ObjectSpec> objects;  // object id = index
  RecordSpec record;
  std::vector<OptionSpec> options;
};

// Checks ranges and cross-field rules that do not need a line number. Returns "" or one clause that names the
// field, its value and what would be right: "world.dt = 0: must be greater than 0".
std::string problem_with(const WorldSpec&);
std::string problem_with(const Material&);
std::string problem_with(const SurfaceSpec&);
std::string problem_with(const ObjectSpec&);

}  // namespace smartsurf::scene
