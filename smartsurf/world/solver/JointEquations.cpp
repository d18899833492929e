#include "smartsurf/world/solver/JointEquations.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <utility>

#include "common/index/UnionFind.h"

namespace smartsurf::world {
namespace {

// The matrix is symmetric and positive definite, so sweeps over its columns need no pivoting.
JointEquations::Matrix6 inverse_of(JointEquations::Matrix6 a) {
  for (int k = 0; k < 6; ++k) {
    const JointEquations::Vector6 column = a.col(k);
    const JointEquations::Vector6 scaled = column / column[k];
    a.noalias() -= scaled * column.transpose();
    a.col(k) = scaled;
    a.row(k) = scaled.transpose();
    a(k, k) = -1.0 / column[k];
  }
  return -a;
}

}  // namespace

void JointEquations::find_trees(std::int32_t body_count,
                                std::span<const std::array<std::int32_t, 2>> joints) {
  // Union of the bodies that a joint connects; the least body of a tree is its root.
  std::vector<std::int32_t> parent(body_count);
  std::iota(parent.begin(), parent.end(), 0);
  for (const auto& [a, b] : joints) {
    if (a == kFixed || b == kFixed) continue;
    const std::int32_t root_a = common::find_root(parent, a), root_b = common::find_root(parent, b);
    parent[std::max(root_a, root_b)] = std::min(root_a, root_b);
  }
  trees_.clear();
  std::vector<std::int32_t> tree_of(parent.size());
  for (std::int32_t i = 0; i < body_count; ++i) {
    const std::int32_t root = common::find_root(parent, i);
    if (root == i) {
      tree_of[i] = static_cast<std::int32_t>(trees_.size());
      trees_.push_back({});
    }
    ++trees_[tree_of[i] = tree_of[root]].body_count;
  }
  std::vector<std::int32_t> tree_of_joint;
  std::vector<char> is_held(trees_.size(), 0);
  for (const auto& [a, b] : joints) {
    tree_of_joint.push_back(a == kFixed && b == kFixed ? -1 : tree_of[a == kFixed ? b : a]);
    if (tree_of_joint.back() < 0) continue;
    ++trees_[tree_of_joint.back()].joint_count;
    if (a == kFixed || b == kFixed) is_held[tree_of_joint.back()] = 1;
  }
  std::int32_t bodies = 0, joint_count = 0;
  for (std::size_t i = 0; i < trees_.size(); ++i) {
    Tree& t = trees_[i];
    t.first_body = bodies, t.first_joint = joint_count;
    bodies += t.body_count, joint_count += t.joint_count;
    t.has_loop = t.joint_count > t.body_count - (is_held[i] ? 0 : 1);
  }
  tree_bodies_.resize(bodies);
  tree_joints_.resize(joint_count);
  std::vector<std::int32_t> next_body, next_joint;
  for (const Tree& t : trees_) next_body.push_back(t.first_body), next_joint.push_back(t.first_joint);
  for (std::int32_t i = 0; i < body_count; ++i) tree_bodies_[next_body[tree_of[i]]++] = i;
  for (std::size_t k = 0; k < joints.size(); ++k)
    if (tree_of_joint[k] >= 0) tree_joints_[next_joint[tree_of_joint[k]]++] = static_cast<std::int32_t>(k);
}

// The next node is one with the fewest neighbours. A joint waits for one of its bodies: only then is its own
// block other than its compliance.
void JointEquations::set_structure(std::int32_t body_count,
                                   std::span<const std::array<std::int32_t, 2>> joints) {
  find_trees(body_count, joints);
  const std::size_t bodies = body_count, nodes = bodies + joints.size();
  std::vector<std::set<std::int32_t>> neighbours(nodes);
  for (std::size_t k = 0; k < joints.size(); ++k)
    for (const std::int32_t body : joints[k])
      if (body != kFixed) {
        neighbours[body].insert(static_cast<std::int32_t>(bodies + k));
        neighbours[bodies + k].insert(body);
      }
  place_of_body_.resize(bodies), place_of_joint_.resize(joints.size());
  edge_of_joint_.assign(joints.size(), {-1, -1});
  is_joint_.clear(), first_edge_.clear(), later_place_.clear(), first_fill_.clear(), fill_edge_.clear();
  places_of_tree_.clear();
  std::vector<std::int32_t> node_at;
  std::vector<std::vector<std::int32_t>> later_nodes;
  std::vector<char> may_go(nodes, 0);
  std::fill_n(may_go.begin(), bodies, 1);
  for (const Tree& t : trees_) {
    const auto begin = static_cast<std::int32_t>(node_at.size());
    std::set<std::pair<std::size_t, std::int32_t>> queue;  // by number of neighbours
    auto push = [&](std::int32_t node) { queue.insert({neighbours[node].size(), node}); };
    auto pop = [&](std::int32_t node) { queue.erase({neighbours[node].size(), node}); };
    for (std::int32_t i = 0; i < t.body_count; ++i) push(tree_bodies_[t.first_body + i]);
    while (!queue.empty()) {
      const std::int32_t node = queue.begin()->second;
      queue.erase(queue.begin());
      const std::vector<std::int32_t> around(neighbours[node].begin(), neighbours[node].end());
      for (const std::int32_t n : around) {
        if (may_go[n]) pop(n);
        neighbours[n].erase(node);
        for (const std::int32_t m : around)
          if (m != n) neighbours[n].insert(m);
        if (node < body_count) may_go[n] = 1;
      }
      for (const std::int32_t n : around)
        if (may_go[n]) push(n);
      node_at.push_back(node);
      later_nodes.push_back(around);
    }
    places_of_tree_.push_back({begin, static_cast<std::int32_t>(node_at.size())});
  }
  std::vector<std::int32_t> place_of(nodes, -1);
  for (std::size_t p = 0; p < node_at.size(); ++p) place_of[node_at[p]] = static_cast<std::int32_t>(p);
  for (std::size_t i = 0; i < bodies; ++i) place_of_body_[i] = place_of[i];
  for (std::size_t k = 0; k < joints.size(); ++k) place_of_joint_[k] = place_of[bodies + k];
  most_edges_ = 0;
  for (std::size_t p = 0; p < node_at.size(); ++p) {
    is_joint_.push_back(node_at[p] >= body_count ? 1 : 0);
    first_edge_.push_back(static_cast<std::int32_t>(later_place_.size()));
    for (const std::int32_t n : later_nodes[p]) later_place_.push_back(place_of[n]);
    std::sort(later_place_.begin() + first_edge_.back(), later_place_.end());
    most_edges_ = std::max(most_edges_, later_nodes[p].size());
  }
  first_edge_.push_back(static_cast<std::int32_t>(later_place_.size()));
  auto edge_between = [&](std::int32_t p, std::int32_t q) {
    const auto [earlier, later] = std::minmax(p, q);
    const auto begin = later_place_.begin() + first_edge_[earlier],
               end = later_place_.begin() + first_edge_[earlier + 1];
    return static_cast<std::int32_t>(std::lower_bound(begin, end, later) - later_place_.begin());
  };
  for (std::size_t p = 0; p < node_at.size(); ++p) {
    first_fill_.push_back(static_cast<std::int32_t>(fill_edge_.size()));
    for (std::int32_t e = first_edge_[p]; e < first_edge_[p + 1]; ++e)
      for (std::int32_t f = first_edge_[p]; f < e; ++f)
        fill_edge_.push_back(edge_between(later_place_[f], later_place_[e]));
  }
  for (std::size_t k = 0; k < joints.size(); ++k)
    for (const std::size_t side : {0, 1})
      if (joints[k][side] != kFixed)
        edge_of_joint_[k][side] = edge_between(place_of_joint_[k], place_of_body_[joints[k][side]]);
  diagonal_.resize(node_at.size());
  value_.resize(node_at.size());
  edge_.resize(later_place_.size());
}

void JointEquations::begin(std::int32_t tree) {
  if (!trees_[tree].has_loop) return;  // then all blocks are of joints
  const auto [begin, end] = places_of_tree_[tree];
  for (std::int32_t e = first_edge_[begin]; e < first_edge_[end]; ++e) edge_[e].setZero();
}

void JointEquations::set_jacobian(std::int32_t joint, int side, const Matrix6& jacobian) {
  const std::int32_t e = edge_of_joint_[joint][side];
  if (e < 0) return;
  // The block's rows are those of the later node.
  if (later_place_[e] == place_of_joint_[joint])
    edge_[e] = jacobian;
  else
    edge_[e] = jacobian.transpose();
}

// The unknowns are dv and −dλ, which makes the matrix symmetric; the blocks of joints are negative definite.
void JointEquations::factor(std::int32_t tree) {
  thread_local std::vector<Matrix6> product;  // of one place's edges
  if (product.size() < most_edges_) product.resize(most_edges_);
  const auto [begin, end] = places_of_tree_[tree];
  for (std::int32_t p = begin; p < end; ++p) {
    const Matrix6 inverse = diagonal_[p] = inverse_of(diagonal_[p]);
    const std::int32_t first = first_edge_[p], last = first_edge_[p + 1];
    const std::int32_t* fill = fill_edge_.data() + first_fill_[p];
    // Diagonals of joints are kept with the opposite sign.
    const bool is_joint = is_joint_[p] != 0;
    for (std::int32_t e = first; e < last; ++e) {
      Matrix6& scaled = product[e - first];
      scaled.noalias() = edge_[e] * inverse;
      for (std::int32_t f = first; f < e; ++f) {
        const std::int32_t target = *fill++;
        if (is_joint)
          edge_[target].noalias() += scaled * edge_[f].transpose();
        else
          edge_[target].noalias() -= scaled * edge_[f].transpose();
      }
      Matrix6& later = diagonal_[later_place_[e]];
      if (is_joint == (is_joint_[later_place_[e]] != 0))
        later.noalias() -= scaled * edge_[e].transpose();
      else
        later.noalias() += scaled * edge_[e].transpose();
    }
    for (std::int32_t e = first; e < last; ++e)
      if (is_joint)
        edge_[e] = -product[e - first];
      else
        edge_[e] = product[e - first];
  }
}

void JointEquations::solve(std::int32_t tree) {
  const auto [begin, end] = places_of_tree_[tree];
  for (std::int32_t p = begin; p < end; ++p)
    for (std::int32_t e = first_edge_[p]; e < first_edge_[p + 1]; ++e)
      value_[later_place_[e]].noalias() -= edge_[e] * value_[p];
  for (std::int32_t p = end - 1; p >= begin; --p) {
    const Vector6 scaled = diagonal_[p] * value_[p];
    value_[p] = is_joint_[p] ? Vector6(-scaled) : scaled;
    for (std::int32_t e = first_edge_[p]; e < first_edge_[p + 1]; ++e)
      value_[p].noalias() -= edge_[e].transpose() * value_[later_place_[e]];
  }
  for (std::int32_t p = begin; p < end; ++p)
    if (is_joint_[p]) value_[p] = -value_[p];
}

}  // namespace smartsurf::world
