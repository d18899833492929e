// The immutable description of one experiment: plain values that every other module reads and none changes.
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

#include "common/error/UserError.h"
#include "smartsurf/scene/ActuatorSpec.h"
#include "smartsurf/scene/SensorSpec.h"
#include "smartsurf/scene/Solid.h"

namespace smartsurf::scene {

// A mistake in an experiment, program or file: one line; the program exits with status 2.
using InputError = common::UserError;

// The nearest of `known` to `word` by edit distance, or "" when nothing is near enough to suggest.
std::string nearest_name(const std::string& word, const std::vector<std::string>& known);

// A number as messages show it: short, in the C locale.
std::string format_number(double);

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

enum class OffTablePolicy { kKeep, kRemove };

struct WorldSpec {
  Eigen::Vector3d gravity{0.0, 0.0, -9.81};  // u/s²
  double dt_s = 1.0 / 240.0;                 // one fixed physics step
  int iterations = 10;                       // of the constraint solver, per step
  double control_period_s = 1.0 / 60.0;      // an integer number of physics steps
  std::uint64_t seed = 1;
  bool ground = true;  // an endless floor under the table, that catches what falls off
  OffTablePolicy off_table = OffTablePolicy::kKeep;  // what becomes of objects that leave the table

  // Physics steps in one control period (≥ 1).
  int steps_per_tick() const;
};

// Capsules, cylinders and cones stand along their own z axis, a cone with its tip up. kSolid: a convex hull,
// or a mesh in convex pieces.
enum class ShapeKind { kSphere, kBox, kCylinder, kCapsule, kCone, kSolid };
inline constexpr int kShapeKindCount = 6;

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
  // What magnets act on, in the object's own frame. Units: those of a magnet's `strength`; 0: not magnetic.
  double magnetic_pole = 0.0;                      // a single pole at the centre of mass
  Eigen::Vector3d magnetic_moment{0.0, 0.0, 0.0};  // a dipole there

  double volume() const;
  // Half extents of the box about the centre of mass, in the object's own frame, that encloses the shape.
  Eigen::Vector3d half_extents() const;
};

// The body of every cell, a rectangular pin, and how far and fast those cells move that are pins.
struct PinSpec {
  double top_x = 0.8, top_y = 0.8;  // edges of the top, ≤ pitch
  double length = 2.0;
  double min_height = 0.0, max_height = 6.0;  // z of the top: the lowest and the highest of all cells
  double max_speed = 20.0;                    // u/s
  double max_acceleration = 400.0;            // u/s²
};

// Where a cell of a free layout stands.
struct CellPose {
  double x = 0.0, y = 0.0;  // centre of its top, u
  double angle = 0.0;       // its turn about z, rad
};

inline constexpr std::int8_t kEmptyCell = -1;

// What is wrong with some actuators. Fractions are of all cells; who is hit is drawn with the world's seed,
// each cell at most once.
struct ActuatorFaultSpec {
  double stuck_fraction = 0.0;                  // fraction of cells whose channels hold a random value
  double dead_fraction = 0.0;                   // … hold their safe value
  double weak_fraction = 0.0, weak_gain = 1.0;  // … move only so much of the way from it
  int latency_ticks = 0;                        // control periods by which every command is late
};

// Faults of single cells, as a table that a user measured: surface/FaultMap.h reads it.
struct FaultMapFile {
  std::string name;  // as the user gave it
  std::string text;  // what is in it
};

struct FaultSpec {
  ActuatorFaultSpec actuator;
  ParameterValues sensor_errors;  // imperfections() of all sensors that say nothing else themselves
  std::optional<FaultMapFile> fault_map;
};

struct SurfaceSpec {
  int rows = 64, columns = 64;
  double pitch = 1.0;
  PinSpec pin;
  std::vector<ActuatorSpec> actuators;  // empty: one, a pin as `pin` says
  // rows × columns, row-major, row 0 north; each may be empty.
  std::vector<std::int8_t> actuator_of_cell;  // index of `actuators`, or kEmptyCell; empty: 0 everywhere
  std::vector<CellPose> cell_poses;           // empty: a rectangular grid
  std::vector<float> base_heights;     // added to the height of each cell's top, u; empty: 0 everywhere
  Eigen::Vector2d tilt_rad{0.0, 0.0};  // of the whole table about x, then y; gravity is turned by it
  std::vector<SensorSpec> sensors;
  std::optional<double> border_height;  // the outermost ring of cells is held at this height
  int material = 0;
  FaultSpec faults;

  int cell_count() const { return rows * columns; }
  // Names of the sensor channels, in the order of the sensors.
  std::vector<std::string> sensor_channels() const;
  // The actuators there are: at least one.
  std::vector<ActuatorSpec> effective_actuators() const;
  // Their channels. Actuators with a channel of one name share it; its range is then the widest of theirs.
  std::vector<ActuatorChannel> actuator_channels() const;
  int index(int row, int column) const { return row * columns + column; }
  bool is_border(int row, int column) const {
    return row == 0 || column == 0 || row == rows - 1 || column == columns - 1;
  }
  bool is_empty(int row, int column) const {
    return !actuator_of_cell.empty() &&
           actuator_of_cell[static_cast<std::size_t>(index(row, column))] == kEmptyCell;
  }
  Eigen::Vector2d centre(int row, int column) const {
    if (cell_poses.empty()) return {column * pitch, (rows - 1 - row) * pitch};
    const CellPose& pose = cell_poses[static_cast<std::size_t>(index(row, column))];
    return {pose.x, pose.y};
  }
};

// Sets `pin` to what the surface's actuators have in common: the body, and the heights that their tops can
// have. Does nothing where `actuators` is empty but for the base.
void derive_pin_spec(SurfaceSpec&);

// A pin with the limits and the body of `pin`.
ActuatorSpec make_pin_actuator(const PinSpec& pin);

struct RecordSpec {
  bool objects = true, sensors = false, actuators = false;
  int tick_interval = 1;  // control periods between two recorded frames
};

// One name that the script made an option: listed by --help, changed by --set name=value.
struct OptionSpec {
  std::string name;
  std::string value;  // as text: the default, or what --set gave
  std::string help;
};

struct SceneSpec {
  std::string file;    // the experiment's path, as the user gave it
  std::string source;  // its source, for the recording
  WorldSpec world;
  std::vector<Material> materials{Material{}};  // [0] is "default"
  SurfaceSpec surface;
  std::vector<ObjectSpec> objects;  // object id = index
  RecordSpec record;
  std::vector<OptionSpec> options;
};

// Checks ranges and cross-field rules that do not need a line number. Returns "" or one clause that names the
// field, its value and what would be right: "world.dt = 0: must be greater than 0".
std::string validate(const WorldSpec&);
std::string validate(const Material&);
std::string validate(const SurfaceSpec&);
std::string validate(const ObjectSpec&);

}  // namespace smartsurf::scene
