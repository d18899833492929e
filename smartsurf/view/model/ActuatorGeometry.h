// The drawn parts of every actuator but the pin: which meshes, where, how rotated and in which colours. A part is a
// two-colour mesh with one record per instance, so that each kind of part is one draw call. No OpenGL. Allocates in
// the first frame only.
//
//   ball         its upper half, in eight rotating fields
//   wheels       two wheels with spokes, rotating
//   rotor        its shape, rotated
//   magnet       a coil: red repels a positive pole, blue attracts
//   force_field  an arrow along the force, its length proportional to the strength
//   air_jet      a nozzle, and its plume, its height proportional to the flow
//   tile         a plate, tilted like the skin
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::view {

struct TwoColourMesh {
  std::vector<float> vertices;  // x y z, the normal's x y z, and how much of the second colour, 0 … 1
  std::vector<std::uint32_t> indices;  // three corners each
};

struct MeshInstance {
  std::array<float, 3> x, y, z;  // the mesh's axes, scaled, world frame
  std::array<float, 3> centre;   // u
  std::array<std::uint8_t, 4> base_colour,
      accent_colour;  // the two colours: linear light, 255 = 1; [3]: how opaque
};

struct InstancedMesh {
  TwoColourMesh mesh;
  bool translucent = false;  // drawn last, without a shadow
  std::vector<MeshInstance> instances;
};

class ActuatorGeometry {
 public:
  explicit ActuatorGeometry(const scene::SurfaceSpec&);

  // Fills the instances. Where the snapshot has no motion, everything is at rest.
  void update(const scene::Snapshot&);
  std::span<const InstancedMesh> meshes() const { return meshes_; }
  // How far below the cell's top its pin is drawn, so that the part has room, u; rows × columns. Empty: 0.
  std::span<const float> recess() const { return recess_; }

 private:
  // Adds the parts of one cell.
  using InstanceBuilder =
      std::function<void(std::size_t cell, const scene::Snapshot&, const scene::ActuatorState&)>;
  struct CellFrame;
  CellFrame cell_frame(std::size_t cell, const scene::Snapshot&) const;
  std::size_t add_mesh(TwoColourMesh mesh, bool translucent = false);
  InstanceBuilder make_builder(const scene::ActuatorSpec&);
  InstanceBuilder ball_builder(const scene::ActuatorSpec&);
  InstanceBuilder wheel_builder(const scene::ActuatorSpec&);
  InstanceBuilder rotor_builder(const scene::ActuatorSpec&);
  InstanceBuilder arrow_builder();
  InstanceBuilder coil_builder();
  InstanceBuilder jet_builder(const scene::ActuatorSpec&);
  InstanceBuilder plate_builder();
  float neighbour_height(std::size_t cell, int row_step, int column_step, const scene::Snapshot&) const;

  scene::SurfaceSpec surface_;
  float top_edge_;  // the shorter edge of a cell's top, u
  int segments_;    // segments around a round part: fewer where there are many
  std::vector<InstancedMesh> meshes_;
  std::vector<std::size_t> cells_;  // those with parts, and what makes them
  std::vector<std::size_t> builder_of_cell_;
  std::vector<InstanceBuilder> builders_;
  std::vector<float> recess_;
};

}  // namespace smartsurf::view
