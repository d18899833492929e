// The description of one experiment as plain values. Immutable after loading.
//
// Units: lengths in the experiment's arbitrary unit "u", time in seconds, angles in radians, masses in
// density·u³. x points east, y north, z up. The origin is the centre of the south-west cell at height 0. Cell
// (row r, column c) has its centre at x = c·pitch, y = (rows − 1 − r)·pitch; row 0 is north, column 0 is
// west.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/error/UserError.h"
#include "smartsurf/scene/ActuatorSpec.h"
#include "smartsurf/scene/JointSpec.h"
#include "smartsurf/scene/SensorSpec.h"
#include "smartsurf/scene/Solid.h"

namespace smartsurf::scene {

// An error in an experiment, program or file, described in one line. The program exits with status 2.
using InputError = common::UserError;

struct Colour {
  float r = 0.93f, g = 0.62f, b = 0.22f;  // sRGB in [0, 1]; the default is amber, visible on any surface
};

// The values of `material.look`: how the view shades objects of the material. The first is the default.
inline constexpr std::array<const char*, 6> kLookNames = {"plain",     "steel", "rubber",
                                                          "porcelain", "wood",  "acrylic"};
// The colours of objects that do not choose one, by the look of their material.
inline constexpr std::array<Colour, 6> kLookColours = {Colour{},
                                                       {0.78f, 0.79f, 0.80f},
                                                       {0.16f, 0.16f, 0.17f},
                                                       {0.93f, 0.92f, 0.89f},
                                                       {0.66f, 0.45f, 0.26f},
                                                       {0.62f, 0.80f, 0.86f}};

// A contact uses the geometric mean of the two frictions and the larger of the two restitutions.
struct Material {
  std::string name = "default";
  double friction = 0.5;           // Coulomb coefficient, ≥ 0
  double rolling_friction = 0.01;  // lever arm of the rolling resistance, u, ≥ 0
  double restitution = 0.2;        // [0, 1]
  double density = 1.0;            // mass per u³, > 0
  int look = 0;                    // index into kLookNames; of no effect on the physics
};

enum class OffTablePolicy { kKeep, kRemove };

// The values of `world.unit` and of the `unit` of a mesh file.
struct PhysicalUnit {
  const char* name;
  double metres;  // its length
};
inline constexpr PhysicalUnit kPhysicalUnits[] = {{"mm", 0.001}, {"cm", 0.01}, {"in", 0.0254}, {"m", 1.0}};
std::optional<PhysicalUnit> find_physical_unit(std::string_view name);

inline constexpr double kStandardGravity = 9.81;  // m/s²

// The values of `world.engine`; the first is the default.
inline constexpr const char* kEngineNames[] = {"native", "bullet"};

struct WorldSpec {
  std::string engine = kEngineNames[0];                  // the physics engine
  std::optional<PhysicalUnit> unit = {};                 // what u is; absent: not said
  Eigen::Vector3d gravity{0.0, 0.0, -kStandardGravity};  // u/s²
  double dt_s = 1.0 / 240.0;                             // fixed physics time step
  int iterations = 10;                                   // of the constraint solver, per step
  double control_period_s = 1.0 / 60.0;                  // a multiple of dt_s
  std::uint64_t seed = 1;
  bool ground = true;                                // an infinite floor under the table
  bool sleep = true;                                 // whether bodies at rest fall asleep
  OffTablePolicy off_table = OffTablePolicy::kKeep;  // for objects that leave the table

  // Physics steps per control period, ≥ 1.
  int steps_per_tick() const;
};

// Capsules, cylinders and cones are aligned with their local z axis; a cone's tip points up. kSolid is a
// convex hull or a convex decomposition of a mesh.
enum class ShapeKind { kSphere, kBox, kCylinder, kCapsule, kCone, kSolid };
inline constexpr int kShapeKindCount = 6;

struct ObjectSpec {
  ShapeKind shape = ShapeKind::kSphere;
  double radius = 1.0;                      // sphere, cylinder, capsule, cone (base)
  double height = 1.0;                      // cylinder, capsule (caps included), cone
  Eigen::Vector3d size{1.0, 1.0, 1.0};      // box: full edge lengths
  std::shared_ptr<const Solid> solid;       // kSolid; shared between objects
  Eigen::Vector3d position{0.0, 0.0, 0.0};  // of the origin: the centre of mass of the homogeneous shape
  Eigen::Quaterniond orientation{1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d velocity{0.0, 0.0, 0.0};  // of the origin
  Eigen::Vector3d angular_velocity{0.0, 0.0, 0.0};
  Eigen::Vector3d centre_of_mass{0.0, 0.0, 0.0};  // from the origin, body frame, u
  std::optional<Eigen::Matrix3d>
      inertia;                     // about the centre of mass, body frame, mass·u²; overrides the shape's
  std::optional<double> mass;      // overrides the material's density
  std::optional<double> friction;  // overrides the material's
  bool fixed = false;              // static body
  int material = 0;                // index into SceneSpec::materials
  Colour colour;
  std::string label;
  // Magnetic charge and dipole moment at the origin, body frame, in the units of a magnet's
  // `strength`.
  double magnetic_pole = 0.0;
  Eigen::Vector3d magnetic_moment{0.0, 0.0, 0.0};

  double volume() const;
  // Inertia tensor of the homogeneous shape about the origin, body frame, mass·u²; closed forms.
  Eigen::Matrix3d homogeneous_inertia(double of_mass) const;
  // Half extents of the bounding box centred at the origin, in the body frame.
  Eigen::Vector3d half_extents() const;
};

// The pose of a cell in a free layout.
struct CellPose {
  double x = 0.0, y = 0.0;  // centre of the top, u
  double angle = 0.0;       // rotation about z, rad
};
// The centre of a cell in a hexagonal grid: every second row from the south begins half a pitch further
// east.
CellPose hexagonal_pose(int row_from_south, int column, double pitch);

inline constexpr std::int8_t kEmptyCell = -1;
// The sensor channel that shows which cells exist; its name is reserved on surfaces with empty cells.
inline constexpr const char* kOccupancyChannel = "occupancy";

// Random actuator faults. The affected cells are drawn with the world's seed; a cell has at most one fault.
struct ActuatorFaultSpec {
  double stuck_fraction = 0.0;                  // fraction of cells whose channels hold a random value
  double dead_fraction = 0.0;                   // fraction of cells whose channels hold their safe value
  double weak_fraction = 0.0, weak_gain = 1.0;  // fraction of cells whose distance from it is scaled by gain
  int latency_ticks = 0;                        // delay of all commands, in control periods
};

// A table of faults of individual cells; read by surface/FaultMap.h.
struct FaultMapFile {
  std::string name;  // path as given by the user
  std::string text;  // the file's content
};

// A fault of one cell, besides those of the table.
struct CellFault {
  int row = 0, column = 0;
  std::string channel, fault;
  std::optional<double> value;
};

struct FaultSpec {
  ActuatorFaultSpec actuator;
  ParameterValues sensor_errors;  // defaults of sensor_error_parameters() for all sensors
  std::optional<FaultMapFile> fault_map;
  std::vector<CellFault> cells;  // apply after the table
};

// A skin over the actuators, which hold or support it. Its nodes form a grid over the cells inside the
// border, row-major, row 0 in the north, and move vertically; each rectangle of four is two triangles, joined
// along its diagonal from the north-west to the south-east.
struct SkinSpec {
  enum class Kind {
    kKinematic,  // taut: its shape follows from the actuators alone
    kElastic,    // sags under its weight and its loads
  };
  enum class Edge { kFree, kClamped };

  Kind kind = Kind::kKinematic;
  int rows = 0, columns = 0;  // of nodes, ≥ 2
  double margin = 0.0;        // beyond the centres of the outermost cells, u
  Edge edge = Edge::kFree;
  double edge_height = 0.0;  // z of a clamped edge, u
  // The next four are of an elastic skin.
  static constexpr double kDampingTime_s = 0.05;  // damping per tension by default
  double tension = 100.0;                         // force per length, mass/s²
  double density = 0.1;                           // mass per area, mass/u²
  double damping = kDampingTime_s * tension;      // of the tension, mass/s
  bool attached = false;                          // whether the actuators also pull
};

struct SurfaceSpec {
  int rows = 64, columns = 64;
  double pitch = 1.0;
  PinSpec pin;
  std::vector<ActuatorSpec> actuators;  // empty = a single pin described by `pin`
  // The next three are [row][column], row 0 is north, or empty.
  std::vector<std::int8_t> actuator_of_cell;  // index into `actuators` or kEmptyCell; empty = all 0
  std::vector<CellPose> cell_poses;           // empty = a rectangular grid
  std::vector<float> base_heights;            // offset of the height of each cell's top, u; empty = all 0
  Eigen::Vector2d tilt_rad{0.0, 0.0};         // of the table about x, then y; realised by rotating gravity
  std::vector<SensorSpec> sensors;
  std::optional<double> border_height;  // fixed height of the outermost ring of cells
  std::optional<SkinSpec> skin;
  int material = 0;  // of what objects touch: the tops, or the skin over them
  FaultSpec faults;

  int cell_count() const { return rows * columns; }
  // z of the highest top that a cell can have, the border included, u.
  double max_top_height() const { return std::max(pin.max_height, border_height.value_or(pin.max_height)); }
  // z of the ground: the feet of pins at their lowest, u.
  double ground_height() const { return pin.min_height - pin.length; }
  // The names of all sensor channels, in the order of the sensors.
  std::vector<std::string> sensor_channels() const;
  // `actuators`, or the default pin if that is empty.
  std::vector<ActuatorSpec> effective_actuators() const;
  // The extensions of which the surface has actuators or sensors.
  std::vector<Extension> extensions() const;
  // The channels of the effective actuators. Channels with the same name are merged; the range of a merged
  // channel is the union of their ranges, its safe value one that all of them clamp to their own, if any.
  std::vector<ActuatorChannel> actuator_channels() const;
  int index(int row, int column) const { return row * columns + column; }
  // Height of the base under the cell with this index, u.
  float base_height(std::size_t cell) const { return base_heights.empty() ? 0.0F : base_heights[cell]; }
  bool is_border(int row, int column) const {
    return row == 0 || column == 0 || row == rows - 1 || column == columns - 1;
  }
  // True if the skin lies over the cell. Precondition: there is a skin.
  bool is_under_skin(int row, int column) const { return !border_height || !is_border(row, column); }
  // From the skin's south-western to its north-eastern corner, u. Precondition: there is a skin.
  Eigen::AlignedBox2d skin_extent() const;
  bool is_empty(int row, int column) const {
    return !actuator_of_cell.empty() && actuator_of_cell[index(row, column)] == kEmptyCell;
  }
  // True if the rows are those of a hexagonal grid and no top rises by itself or tilts, as a pin's or a
  // tile's does: views draw the tops as hexagons, `pin.top_x` wide between the sides in the west and in the
  // east. O(cells).
  bool has_hexagonal_tops() const;
  // True if the grid is rectangular and the gaps between tops are at most a quarter of the pitch: views close
  // such gaps at the table's edge, through which the background would flicker.
  bool has_narrow_gaps() const;
  // True if the surface has the occupancy channel. O(cells).
  bool has_empty_cells() const;
  // The readings of this channel, row-major: 1 for a cell, 0 for an empty one. Empty if no cell is empty.
  std::vector<float> occupancy() const;
  // What controllers and learners see: the channels of the sensors and, with empty cells, the occupancy.
  std::vector<SensorChannel> observed_channels() const;
  Eigen::Vector2d centre(int row, int column) const {
    if (cell_poses.empty()) return {column * pitch, (rows - 1 - row) * pitch};
    const CellPose& pose = cell_poses[index(row, column)];
    return {pose.x, pose.y};
  }
};

// Derives `pin` from the surface's actuators: the common body and the range of heights, including
// base_heights. An empty `actuators` first becomes the pin that it stands for.
void derive_pin_spec(SurfaceSpec&);

// A pin actuator with the body and limits of `pin`.
ActuatorSpec make_pin_actuator(const PinSpec& pin);

enum class SensorRecording : std::uint8_t {
  kNever,
  kWhereCheap,  // unless they take more than a tenth of the file
  kAlways,
};

struct RecordSpec {
  bool objects = true, actuators = false;
  SensorRecording sensors = SensorRecording::kWhereCheap;
  int tick_interval = 1;  // control periods between recorded frames
};

// An option declared by the script: listed by --help, set by --set name=value.
struct OptionSpec {
  enum class Kind { kInteger, kReal, kBool, kText };

  std::string name;
  std::string value;  // the default or the value of --set, as text
  std::string help;
  Kind kind = Kind::kText;                          // kText also in recordings, which keep the text
  std::optional<std::array<double, 2>> range = {};  // low and high of a number; empty = any
  std::vector<std::string> choices = {};            // of a text; empty = any
};

struct SceneSpec {
  std::string file;    // path as given by the user
  std::string source;  // the script's text, for the recording
  WorldSpec world;
  std::vector<Material> materials{Material{}};  // [0] is "default"
  SurfaceSpec surface;
  std::vector<ObjectSpec> objects;  // object id = index
  std::vector<JointSpec> joints;    // joint id = index
  RecordSpec record;
  std::vector<OptionSpec> options;
};

// Check ranges and constraints between fields. Return "" or one clause with the field, its value and the
// constraint: "world.dt = 0: must be greater than 0".
std::string validate(const WorldSpec&);
std::string validate(const Material&);
std::string validate(const SurfaceSpec&);
std::string validate(const ObjectSpec&);

}  // namespace smartsurf::scene
