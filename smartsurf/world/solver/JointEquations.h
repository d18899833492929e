// The linear equations of bodies that joints connect:
//
//   M·dv = Jᵀ·dλ   for each body, with its mass matrix M
//   J·dv + E·dλ = r   for each joint, with its compliance E
//
// They are solved directly. Bodies and joints are the nodes of a graph, and a node has one 6 × 6 block; the
// matrix is factored as LDLᵀ, from the leaves of each tree inwards. The work is proportional to the number of
// joints (D. Baraff, Linear-time dynamics using Lagrange multipliers, 1996); a loop adds as many blocks as it
// has joints. In double precision: the inertia of slender links differs by orders of magnitude between axes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace smartsurf::world {

class JointEquations {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  static constexpr std::int32_t kFixed = -1;

  // Bodies that joints connect with each other. Those that cannot move connect nothing.
  struct Tree {
    std::int32_t first_body, body_count, first_joint, joint_count;  // in tree_bodies() and tree_joints()
    bool has_loop;
  };

  // ---- structure; allocates
  // The two bodies of each joint, or kFixed.
  void set_structure(std::int32_t body_count, std::span<const std::array<std::int32_t, 2>> joints);
  std::span<const Tree> trees() const { return trees_; }
  // The bodies and the joints, tree by tree, each ascending.
  std::span<const std::int32_t> tree_bodies() const { return tree_bodies_; }
  std::span<const std::int32_t> tree_joints() const { return tree_joints_; }

  // ---- values; set all of a tree between begin() and factor(), which replaces them. Threads may work on
  // different trees at once.
  void begin(std::int32_t tree);
  Matrix6& mass(std::int32_t body) { return diagonal_[place_of_body_[body]]; }
  Matrix6& compliance(std::int32_t joint) { return diagonal_[place_of_joint_[joint]]; }
  // `side`: 0 for the joint's first body, 1 for the second; a body that is kFixed is ignored.
  void set_jacobian(std::int32_t joint, int side, const Matrix6&);
  void factor(std::int32_t tree);

  // ---- solution: in: r of each joint; out: dλ of each joint and dv of each body
  Vector6& of_body(std::int32_t body) { return value_[place_of_body_[body]]; }
  Vector6& of_joint(std::int32_t joint) { return value_[place_of_joint_[joint]]; }
  void solve(std::int32_t tree);

 private:
  struct Range {
    std::int32_t begin, end;
  };
  void find_trees(std::int32_t body_count, std::span<const std::array<std::int32_t, 2>> joints);

  std::vector<Tree> trees_;
  std::vector<std::int32_t> tree_bodies_, tree_joints_;
  // Places of nodes, in the order of elimination; those of a tree are contiguous.
  std::vector<std::int32_t> place_of_body_, place_of_joint_;
  std::vector<Range> places_of_tree_;
  std::vector<char> is_joint_;                              // by place
  std::vector<Matrix6> diagonal_;                           // by place; after factor() its inverse
  std::vector<Vector6> value_;                              // by place
  std::vector<std::int32_t> first_edge_;                    // by place, and one more
  std::vector<std::int32_t> later_place_;                   // by edge: from a place to a later one, ascending
  std::vector<Matrix6> edge_;                               // the block (later, earlier); after factor() of L
  std::vector<std::int32_t> first_fill_;                    // by place: in fill_edge_
  std::vector<std::int32_t> fill_edge_;                     // of each pair of a place's edges
  std::vector<std::array<std::int32_t, 2>> edge_of_joint_;  // by side; −1: kFixed
  std::size_t most_edges_ = 0;                              // of one place
};

}  // namespace smartsurf::world
