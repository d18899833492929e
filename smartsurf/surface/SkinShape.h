// The supports of a skin, and the shape that they give to a taut one: without weight, the height z follows
// Laplace's equation, ∇²z = 0, between the nodes that actuators or a clamped edge hold; a free edge is level
// across (∂z/∂n = 0). Linear finite elements, factorised once.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/SparseCholesky.h"

namespace smartsurf::surface {

class SkinShape {
 public:
  // Writes Field::skin: its geometry, and its shape over the heights of the field. The surface must have a
  // valid skin.
  SkinShape(const scene::SurfaceSpec&, Field&);

  // Call after the actuators' plan() and commit(). They move a kinematic skin with its actuators, and the
  // supports of an elastic one. They allocate nothing, and cost nothing while no actuator moves.
  void plan(double dt_s, Field&) noexcept;
  void commit(Field&) noexcept;

 private:
  // A node that an actuator holds; dx, dy: from the centre of the cell, u.
  struct Support {
    std::size_t node, cell;
    float dx, dy;
  };
  // A held neighbour of an unknown.
  struct Coupling {
    Eigen::Index unknown;
    std::size_t node;
    double weight;
  };

  void init_geometry(const scene::SurfaceSpec&, Field&);
  void find_supports(const scene::SurfaceSpec&, const Field&);
  void assign_cells(Field&) const;
  void factorise(const Skin&);
  // Writes the held nodes' values, value(support), and solves for the others: values_.
  template <class Value>
  void solve(Value value) noexcept;
  bool any_support_moves(const Field&) const noexcept;

  std::vector<Support> supports_;
  std::vector<std::size_t> clamped_;   // nodes of a clamped edge
  double edge_height_ = 0.0;           // u
  std::vector<std::size_t> unknowns_;  // nodes
  std::vector<Coupling> couplings_;
  SparseCholesky factors_;
  std::vector<double> right_side_;  // one per unknown
  std::vector<double> values_;      // one per node
};

}  // namespace smartsurf::surface
