// The geometry of all actuators except the pin: their meshes and per-instance poses and colours. Each kind of
// part is one two-colour mesh with an array of instances, and so one draw call. No OpenGL. Allocates only in
// the first frame.
//
//   ball         a rotating ball with eight coloured fields
//   wheels       two rotating wheels with coloured sectors
//   rotor        its shape, rotated
//   magnet       a coil: red repels a positive pole, blue attracts it
//   force_field  an arrow along the force, whose length grows with the strength
//   air_jet      a nozzle with a plume, whose height grows with the flow
//   tile         a plate, tilted like the surface around it
//   delta        the tip and three arms
//
// A skin over the actuators is one mesh in world coordinates, whose vertices follow it; what actuators hold
// has the accent colour. The cells under it are drawn low enough for it to cover them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/model/TwoColourMesh.h"

namespace smartsurf::view {

struct MeshInstance {
  std::array<float, 3> x, y, z;  // scaled axes of the mesh, world frame
  std::array<float, 3> centre;   // u
  // RGBA, linear light, 255 = 1.
  std::array<std::uint8_t, 4> base_colour, accent_colour;
};

struct InstancedMesh {
  TwoColourMesh mesh;
  Eigen::Vector3f size = Eigen::Vector3f::Ones();  // of the instances' axes, where it is the same for all
  bool translucent = false;                        // drawn last, casts no shadow
  bool deforms = false;                            // its vertices change from frame to frame
  std::vector<MeshInstance> instances;
};

// The colours of the parts, sRGB, by name.
struct NamedColour {
  const char* name;
  Rgb colour;
};
std::span<const NamedColour> actuator_colours();
// The proportions of the parts and their motions, by name, for renderers that move the parts themselves.
struct NamedNumber {
  const char* name;
  float value;
};
std::span<const NamedNumber> actuator_looks();

class ActuatorGeometry {
 public:
  struct NodeRange {
    int first, last;
  };

  explicit ActuatorGeometry(const scene::SurfaceSpec&);

  // Arrows and plumes that are too weak to be drawn get an instance of no size, so that the n-th instance of
  // a mesh is always the same part.
  void keep_hidden_parts() { keeps_hidden_parts_ = true; }
  // Rebuilds the instances. Without an actuator state in the snapshot, all parts are at rest.
  void update(const scene::Snapshot&);
  std::span<const InstancedMesh> meshes() const { return meshes_; }
  // The meshes of one of the surface's effective_actuators().
  std::span<const InstancedMesh> meshes_of(std::size_t actuator) const {
    return std::span(meshes_).subspan(first_mesh_[actuator],
                                      first_mesh_[actuator + 1] - first_mesh_[actuator]);
  }
  // The skin's nodes around the tops of each row and of each column; empty without a skin.
  std::span<const NodeRange> node_rows() const { return node_rows_; }
  std::span<const NodeRange> node_columns() const { return node_columns_; }
  // How far below the cell's top its pin is drawn, to make space for the part, u; rows × columns, row-major.
  // Empty if no cell has a part.
  std::span<const float> recess() const { return recess_; }

 private:
  // Appends the instances of one cell.
  using InstanceBuilder =
      std::function<void(std::size_t cell, const scene::Snapshot&, const scene::ActuatorState&)>;
  struct CellFrame;
  CellFrame cell_frame(std::size_t cell, const scene::Snapshot&) const;
  std::size_t add_mesh(TwoColourMesh mesh, const Eigen::Vector3f& size = Eigen::Vector3f::Ones(),
                       bool translucent = false);
  // Appends an instance of a mesh.
  void draw(std::size_t mesh, const Eigen::Vector3f& at, const Eigen::Matrix3f& axes, const Rgb& base,
            const Rgb& accent, float base_alpha = 1.0F, float accent_alpha = 1.0F);
  InstanceBuilder make_builder(const scene::ActuatorSpec&);
  InstanceBuilder ball_builder(const scene::ActuatorSpec&);
  InstanceBuilder wheel_builder(const scene::ActuatorSpec&);
  InstanceBuilder rotor_builder(const scene::ActuatorSpec&);
  InstanceBuilder arrow_builder();
  InstanceBuilder coil_builder();
  InstanceBuilder jet_builder(const scene::ActuatorSpec&);
  InstanceBuilder tip_builder(const scene::ActuatorSpec&);
  InstanceBuilder delta_builder(const scene::ActuatorSpec&);
  InstanceBuilder vibrating_plate_builder();
  void add_skin();
  void update_skin(const scene::Snapshot&);
  void update_drops(const scene::Snapshot&);
  InstanceBuilder tilting_plate_builder(const scene::ActuatorSpec&);
  // Height of a neighbour, u; the cell's own height where there is none.
  float neighbour_height(std::size_t cell, int row_step, int column_step, const scene::Snapshot&) const;

  scene::SurfaceSpec surface_;
  float top_edge_;  // the shorter edge of a cell's top, u
  int segments_;    // of round parts; fewer on large surfaces
  bool keeps_hidden_parts_ = false;
  std::vector<InstancedMesh> meshes_;
  std::vector<std::size_t> first_mesh_;       // by actuator, and the number of their meshes
  std::vector<std::size_t> cells_;            // cells with parts
  std::vector<std::size_t> builder_of_cell_;  // parallel to cells_: index into builders_
  std::vector<InstanceBuilder> builders_;
  std::vector<float> recess_;
  std::vector<float>
      drop_;  // how far below its height a cell is drawn under a skin, u; row-major, empty without one
  std::vector<NodeRange> node_rows_, node_columns_;
};

}  // namespace smartsurf::view
