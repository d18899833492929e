// An elastic skin over the cells: its motion, and its contacts.
//
// The height z of the nodes follows M·dv/dt = −K·(T·z + c·v) + M·g + loads, with lumped masses M, the
// stiffness K of linear finite elements, the tension T and its damping c. The velocities are those of the
// middle of each step dt, the tension acts on the mean height z + dt/4·(v' − v) of three states:
//   A·v' = M·(v + dt·g) − dt·T·K·(z − dt/4·v) + J,  A = M + dt·(dt/4·T + c)·K,  z' = z + dt·v'
// This is the trapezoidal rule, which neither damps nor excites an oscillation, at any tension.
// Nodes that a support holds have its velocity. Attached, they stay held; otherwise a support lets go of a
// node that it would pull down, and holds one that would enter it. A is factorised again only where that
// changes.
//
// To the impulses J = W·λ of contacts with the barycentric weights W, the skin answers with the velocities
// C·λ, C = WᵀA⁻¹W. So its contacts are coupled, and are solved one after another, on one thread, in the
// stages of Solver.h; in each substep as if their impulses were those of the whole step. They are inelastic:
// what springs back is the skin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/Skin.h"
#include "smartsurf/surface/SparseCholesky.h"
#include "smartsurf/world/solver/PointContact.h"

namespace smartsurf::world {

class SkinSolver {
 public:
  // gravity: along z, u/s².
  SkinSolver(float dt_s, float gravity, int substeps) : dt_s_(dt_s), gravity_(gravity), substeps_(substeps) {}

  // Once in each step: begin() finds the motion without loads, before the contacts are found; collect() takes
  // them.
  void begin(surface::Skin&);
  void collect(const surface::Skin&, const BodyStore&, const ContactList& static_contacts);
  bool empty() const { return points_.empty(); }

  // The stages of a step, as in TipSolver.
  void begin_step(const PointStep&);
  void solve(const PointStep&);
  void relax(const PointStep&);
  void store(ContactList& static_contacts) const;

  // The vertical impulse of the step on the body at the i-th contact with the skin in the list of collect().
  float impulse_on_body(std::size_t i) const { return points_[i].on_body; }

  // Moves the nodes at the end of the step.
  void advance(surface::Skin&);

 private:
  struct Point : PointContact {
    surface::Skin::Location at;
    float speed, free_speed;  // of the skin there, upward, and without loads, u/s
    float moved = 0.0F;       // of the skin there, in this step, u
    float load = 0.0F;        // downward impulse of the step on the skin, mass·u/s
    float on_body = 0.0F;     // upward impulse of the step on the body, without that of the push-out
  };
  struct Neighbour {
    std::size_t node;
    double weight;  // of K
  };

  void build(const surface::Skin&);
  void factorise(const surface::Skin&);
  // Solves for the velocities of all nodes under `right_side_`, which has one value per node.
  void solve_motion(const surface::Skin&);
  void update_held(surface::Skin&);
  double stiffness_times(const std::vector<double>& values, std::size_t node) const;  // K·values
  double stiffness_scale(const surface::Skin&) const;                                 // of K in A
  void solve_point(std::size_t, float target_speed, const PointStep&);
  void add_impulse(std::size_t, const Vec3& change, const PointStep&);
  Vec3 relative_velocity(const Point&, const PointStep&) const;

  float dt_s_, gravity_;
  int substeps_;
  std::vector<double> mass_;                  // of each node
  std::vector<std::size_t> first_neighbour_;  // by node, in neighbours_
  std::vector<Neighbour> neighbours_;
  Eigen::SparseMatrix<double> system_;
  surface::SparseCholesky factors_;
  std::vector<std::uint8_t> factorised_for_;             // Skin::held
  std::vector<double> free_speed_, right_side_, speed_;  // by node
  std::vector<Point> points_;
  std::vector<surface::SparseCholesky::HalfSolution> half_;  // of the points
  std::vector<double> products_;
  std::vector<float> compliance_;  // points × points: C times the substeps
};

}  // namespace smartsurf::world
