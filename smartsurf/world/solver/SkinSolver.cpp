#include "smartsurf/world/solver/SkinSolver.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {

using surface::Skin;

double SkinSolver::stiffness_scale(const Skin& s) const {
  return static_cast<double>(dt_s_) * (0.25 * static_cast<double>(dt_s_) * s.tension + s.damping);
}

void SkinSolver::build(const Skin& s) {
  const std::size_t n = s.nodes();
  mass_.assign(n, 0.0);
  std::vector<std::vector<Neighbour>> neighbours(n);
  surface::for_each_edge(s, [&](std::size_t a, std::size_t b, double weight) {
    neighbours[a].push_back({b, weight});
    neighbours[b].push_back({a, weight});
  });
  const double quarter = 0.25 * static_cast<double>(s.density) * s.spacing_x * s.spacing_y;
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      const int rows = (r > 0 ? 1 : 0) + (r + 1 < s.rows ? 1 : 0),
                columns = (c > 0 ? 1 : 0) + (c + 1 < s.columns ? 1 : 0);
      mass_[s.index(r, c)] = quarter * rows * columns;
    }
  first_neighbour_.assign(1, 0);
  neighbours_.clear();
  for (const auto& of_node : neighbours) {
    neighbours_.insert(neighbours_.end(), of_node.begin(), of_node.end());
    first_neighbour_.push_back(neighbours_.size());
  }
  free_speed_.assign(n, 0.0);
  right_side_ = speed_ = free_speed_;
}

// Held nodes keep their rows, of which only the diagonal is not 0, so that the pattern of the matrix stays
// the same.
void SkinSolver::factorise(const Skin& s) {
  const bool is_first = system_.rows() == 0;
  std::vector<Eigen::Triplet<double>> entries;
  const double scale = stiffness_scale(s);
  for (std::size_t i = 0; i < s.nodes(); ++i) {
    double diagonal = mass_[i];
    for (std::size_t k = first_neighbour_[i]; k < first_neighbour_[i + 1]; ++k) {
      const Neighbour& n = neighbours_[k];
      diagonal += scale * n.weight;
      if (n.node > i) continue;
      const bool is_cut = s.held[i] != 0 || s.held[n.node] != 0;
      entries.emplace_back(i, n.node, is_cut ? 0.0 : -scale * n.weight);
    }
    entries.emplace_back(i, i, diagonal);
  }
  system_.resize(std::ssize(mass_), std::ssize(mass_));
  system_.setFromTriplets(entries.begin(), entries.end());
  if (is_first) factors_.analyse(system_);
  factors_.factorise(system_);
  factorised_for_ = s.held;
}

void SkinSolver::solve_motion(const Skin& s) {
  const double scale = stiffness_scale(s);
  speed_ = right_side_;
  for (std::size_t i = 0; i < s.nodes(); ++i) {
    if (s.held[i] == 0) continue;
    speed_[i] = 0.0;
    for (std::size_t k = first_neighbour_[i]; k < first_neighbour_[i + 1]; ++k)
      if (const Neighbour& n = neighbours_[k]; s.held[n.node] == 0)
        speed_[n.node] += scale * n.weight * static_cast<double>(s.support_speed[i]);
  }
  factors_.solve(speed_);
  for (std::size_t i = 0; i < s.nodes(); ++i)
    if (s.held[i] != 0) speed_[i] = static_cast<double>(s.support_speed[i]);
}

void SkinSolver::begin(Skin& s) {
  points_.clear();
  if (mass_.empty()) build(s);
  if (factorised_for_ != s.held) factorise(s);
  const double dt = static_cast<double>(dt_s_);
  for (std::size_t i = 0; i < s.nodes(); ++i) {
    if (s.held[i] != 0) s.height[i] = s.support_height[i];
    free_speed_[i] = static_cast<double>(s.height[i]) - 0.25 * dt * static_cast<double>(s.speed[i]);
  }
  for (std::size_t i = 0; i < s.nodes(); ++i)
    right_side_[i] = mass_[i] * (static_cast<double>(s.speed[i]) + dt * gravity_) -
                     dt * s.tension * stiffness_times(free_speed_, i);
  solve_motion(s);
  free_speed_ = speed_;
}

double SkinSolver::stiffness_times(const std::vector<double>& values, std::size_t node) const {
  double sum = 0.0;
  for (std::size_t k = first_neighbour_[node]; k < first_neighbour_[node + 1]; ++k)
    sum += neighbours_[k].weight * (values[node] - values[neighbours_[k].node]);
  return sum;
}

void SkinSolver::collect(const Skin& s, const BodyStore& bodies, const ContactList& static_contacts) {
  points_.clear();
  for (const Manifold& m : static_contacts.manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts.contacts[k];
      if (c.partner != Partner::kElasticSkin) continue;
      const Vec3 point = bodies.position[m.a] + c.anchor;
      Point& p = points_.emplace_back();
      p.contact = k, p.body = m.a;
      p.at = s.locate(point.x(), point.y());
      p.free_speed = p.speed = 0.0F;
      for (int i = 0; i < 3; ++i)
        p.free_speed += p.at.weight[i] * static_cast<float>(free_speed_[p.at.node[i]]);
      p.speed = p.free_speed;
    }
  const std::size_t n = points_.size();
  if (half_.size() < n) half_.resize(n);
  products_.resize(n);
  compliance_.resize(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    const Skin::Location& at = points_[i].at;
    float weight[3];
    for (int k = 0; k < 3; ++k) weight[k] = s.held[at.node[k]] != 0 ? 0.0F : at.weight[k];
    factors_.half_solve(at.node, weight, half_[i]);
    factors_.multiply(half_[i], std::span(half_).first(i + 1), products_);
    for (std::size_t j = 0; j <= i; ++j)
      compliance_[i * n + j] = compliance_[j * n + i] = static_cast<float>(substeps_ * products_[j]);
  }
}

void SkinSolver::begin_step(const PointStep& step) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Point& p = points_[i];
    Mat3 response = Mat3::Zero();
    response(2, 2) = compliance_[i * points_.size() + i];
    p.prepare(step, response);
    add_impulse(i, p.impulse(), step);
  }
}

void SkinSolver::add_impulse(std::size_t index, const Vec3& change, const PointStep& step) {
  points_[index].apply(change, step);
  const float* const row = &compliance_[index * points_.size()];
  for (std::size_t j = 0; j < points_.size(); ++j) points_[j].speed -= row[j] * change.z();
}

Vec3 SkinSolver::relative_velocity(const Point& p, const PointStep& step) const {
  return p.velocity(step) - p.speed * Vec3::UnitZ();
}

void SkinSolver::solve_point(std::size_t index, float target_speed, const PointStep& step) {
  Point& p = points_[index];
  const float old_impulse = p.normal_impulse;
  p.normal_impulse = p.normal_impulse_for(target_speed, relative_velocity(p, step));
  add_impulse(index, (p.normal_impulse - old_impulse) * p.normal, step);
  add_impulse(index, p.solve_friction(relative_velocity(p, step)), step);
  p.solve_rolling(step);
}

void SkinSolver::solve(const PointStep& step) {
  for (std::size_t i = 0; i < points_.size(); ++i)
    solve_point(i, points_[i].push_out_speed({0, 0, points_[i].moved}, step), step);
}

void SkinSolver::relax(const PointStep& step) {
  for (Point& p : points_) {
    p.moved += step.params.h_s * p.speed;
    p.load += p.impulse().z();
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    solve_point(i, points_[i].relax_target_speed, step);
    points_[i].total_normal_impulse += points_[i].normal_impulse;
    points_[i].on_body += points_[i].impulse().z();
  }
}

void SkinSolver::store(ContactList& static_contacts) const {
  for (const Point& p : points_) p.PointContact::store(static_contacts.contacts[p.contact]);
}

void SkinSolver::advance(Skin& s) {
  for (const Point& p : points_)
    for (int i = 0; i < 3; ++i)
      right_side_[p.at.node[i]] -= static_cast<double>(p.at.weight[i]) * static_cast<double>(p.load);
  if (points_.empty())
    speed_ = free_speed_;
  else
    solve_motion(s);
  for (std::size_t i = 0; i < s.nodes(); ++i) {
    s.speed[i] = static_cast<float>(speed_[i]);
    s.height[i] += dt_s_ * s.speed[i];
  }
  if (!s.attached) update_held(s);
}

// Sets the held nodes of the next step. A node that would enter a support stops on it in this one.
void SkinSolver::update_held(Skin& s) {
  const double scale = stiffness_scale(s);
  for (std::size_t i = 0; i < s.nodes(); ++i) {
    if (!std::isfinite(s.support_height[i]) || s.is_clamped[i] != 0) continue;
    if (s.held[i] == 0) {
      const float support = s.support_height[i] + dt_s_ * s.support_speed[i];
      if (s.height[i] > support) continue;
      s.height[i] = support, s.speed[i] = s.support_speed[i];
      s.held[i] = 1;
      continue;
    }
    // The impulse by which the support pushes the node up in this step.
    const double push = mass_[i] * speed_[i] + scale * stiffness_times(speed_, i) - right_side_[i];
    if (push < 0.0) s.held[i] = 0;
  }
}

}  // namespace smartsurf::world
