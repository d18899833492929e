#include "smartsurf/world/solver/TipSolver.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/index/UnionFind.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

// Upper bound of the deflecting load, in multiples of that of its normal part: friction adds less than as
// much again.
constexpr float kMaxDeflection = 2.0F;

// The greatest s in [0, 1] with |others − s·own| ≤ limit; if there is none, the s for which that is least.
float greatest_share(const Vec3& others, const Vec3& own, float limit) {
  const float a = own.squaredNorm(), b = others.dot(own), c = others.squaredNorm() - limit * limit;
  if (a == 0.0F) return 1.0F;
  const float discriminant = b * b - a * c;
  return std::clamp((b + std::sqrt(std::max(0.0F, discriminant))) / a, 0.0F, 1.0F);
}

}  // namespace

Vec3 TipSolver::Tip::deflecting_load() const {
  const Vec3 borne = load - normal_load + law::clamp_length(normal_load, max_impulse);
  return law::clamp_length(borne, kMaxDeflection * max_impulse);
}

Vec3 TipSolver::Tip::deflection_rate() const { return response * deflecting_load() - spring_rate; }

Mat3 TipSolver::Tip::directions_with_load() const {
  if (!is_loaded) return Mat3::Zero();
  if (sticks && !is_overloaded) return Mat3::Identity();
  const Vec3 normal = normal_load.normalized();
  const Mat3 along = normal * normal.transpose();
  Mat3 with_load = Mat3::Zero();
  if (!is_overloaded) with_load += along;
  if (sticks) with_load += Mat3::Identity() - along;
  return with_load;
}

void TipSolver::Tip::begin_substep(float h_s) {
  const float k = kind->stiffness, c = kind->damping;
  if (!std::isfinite(k)) return;
  // What touches an unloaded tip will be its load.
  const Mat3 trapezoidal = is_loaded ? directions_with_load() : Mat3(Mat3::Identity());
  const Mat3 implicit = Mat3::Identity() - trapezoidal;
  const float trapezoidal_damping = c + 0.25F * h_s * k, implicit_damping = c + h_s * k;
  response = trapezoidal / (h_s * trapezoidal_damping) + implicit / (h_s * implicit_damping);
  spring_rate = k * (trapezoidal * (deflection - 0.25F * h_s * rate) / trapezoidal_damping +
                     implicit * deflection / implicit_damping);
}

Vec3 TipSolver::Tip::rate_in_substep(float h_s) const {
  const float k = kind->stiffness;
  if (!std::isfinite(k)) return Vec3::Zero();
  const Vec3 force = is_loaded ? Vec3(deflecting_load() / h_s) : Vec3(Vec3::Zero());
  const Vec3 under_given_load = (force - k * deflection) / (kind->damping + h_s * k);
  return under_given_load + directions_with_load() * (deflection_rate() - under_given_load);
}

float TipSolver::Tip::room_along(const Vec3& direction) const {
  const auto at = held_position.head<2>();
  const auto u = direction.head<2>();
  constexpr float kParallel = 1e-6F;
  float room = std::numeric_limits<float>::infinity();
  if (const float a = u.squaredNorm(); a > kParallel) {
    const float b = at.dot(u), c = at.squaredNorm() - kind->workspace_radius * kind->workspace_radius;
    room = (std::sqrt(std::max(0.0F, b * b - a * c)) - b) / a;
  }
  if (std::abs(direction.z()) > kParallel) {
    const float boundary = direction.z() > 0.0F ? kind->workspace_high : kind->workspace_low;
    room = std::min(room, (boundary - held_position.z()) / direction.z());
  }
  return std::max(0.0F, room);
}

void TipSolver::collect(const surface::Field& field, const ContactList& static_contacts) {
  clear_contacts();
  tip_of_cell_.resize(field.height.size(), -1);
  for (const Manifold& m : static_contacts.manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts.contacts[k];
      if (c.partner != Partner::kYieldingTip) continue;
      std::int32_t& tip = tip_of_cell_[c.feature_id];
      if (tip < 0) {
        tip = static_cast<std::int32_t>(cells_.size());
        cells_.push_back(c.feature_id);
      }
      Point& p = points_.emplace_back();
      p.contact = k, p.tip = tip, p.body = m.a;
    }
  for (const std::int32_t cell : cells_) {
    const surface::YieldingTip& y = field.yielding[cell];
    Tip& t = tips_.emplace_back();
    t.kind = &field.tip_at(cell);
    t.held_position = y.held_position, t.held_velocity = y.held_velocity;
    t.start_deflection = t.deflection = y.deflection;
  }
  for (std::size_t k = 0; k < loaded_cells_.size(); ++k)
    if (const std::int32_t tip = tip_of_cell_[loaded_cells_[k]]; tip >= 0) tips_[tip].rate = loaded_rates_[k];
  for (const std::int32_t cell : cells_) tip_of_cell_[cell] = -1;
  find_islands();
}

// Islands are numbered in the order of their first tips, so that they do not depend on the number of threads.
void TipSolver::find_islands() {
  const auto tip_count = static_cast<std::int32_t>(tips_.size());
  tip_parent_.resize(tips_.size());
  std::iota(tip_parent_.begin(), tip_parent_.end(), 0);
  for (const Point& p : points_) {
    if (p.body >= std::ssize(tip_of_body_)) tip_of_body_.resize(p.body + 1, -1);
    std::int32_t& first = tip_of_body_[p.body];
    if (first < 0) first = p.tip;
    const std::int32_t a = common::find_root(tip_parent_, first), b = common::find_root(tip_parent_, p.tip);
    tip_parent_[std::max(a, b)] = std::min(a, b);
  }
  for (const Point& p : points_) tip_of_body_[p.body] = -1;
  islands_.clear();
  island_of_tip_.resize(tips_.size());
  tip_order_.resize(tips_.size());
  for (std::int32_t t = 0; t < tip_count; ++t) {
    const std::int32_t root = common::find_root(tip_parent_, t);
    if (root == t) {
      island_of_tip_[t] = static_cast<std::int32_t>(islands_.size());
      islands_.push_back({0, 0});
    }
    island_of_tip_[t] = island_of_tip_[root];
    tip_order_[t] = t;
  }
  islands_.push_back({static_cast<std::int32_t>(points_.size()), tip_count});
  const auto island_of = [this](std::int32_t tip) { return island_of_tip_[tip]; };
  std::ranges::stable_sort(tip_order_, {}, island_of);
  std::ranges::stable_sort(points_, {}, [&](const Point& p) { return island_of(p.tip); });
  for (std::size_t k = tip_order_.size(); k-- > 0;)
    islands_[island_of(tip_order_[k])].first_tip = static_cast<std::int32_t>(k);
  for (std::size_t k = points_.size(); k-- > 0;)
    islands_[island_of(points_[k].tip)].first_point = static_cast<std::int32_t>(k);
}

IndexRange TipSolver::share(const Member& member) const {
  const auto count = static_cast<int>(islands_.size()) - 1;
  const auto first_island = [&](int index) {
    if (index == member.member_count) return count;
    const long wanted = static_cast<long>(points_.size()) * index / member.member_count;
    return static_cast<int>(std::ranges::lower_bound(islands_, wanted, {}, &Island::first_point) -
                            islands_.begin());
  };
  return {first_island(member.index), first_island(member.index + 1)};
}

void TipSolver::begin_step(const PointStep& step, IndexRange islands) {
  const float h_s = step.params.h_s;
  for_each_tip(islands, [&](Tip& t) {
    t.max_impulse = t.kind->max_force * h_s;
    t.begin_substep(h_s);
  });
  for (Point& p : points_of(islands)) {
    Tip& tip = tips_[p.tip];
    p.prepare(step, tip.response);
    p.apply(p.impulse(), step);
    tip.add_load(-p.impulse(), -p.normal_impulse * p.normal);
  }
  classify_loads(islands);
}

Vec3 TipSolver::relative_velocity(const Point& p, const PointStep& step) const {
  return p.velocity(step) - tips_[p.tip].velocity();
}

void TipSolver::add_normal_impulse(Point& p, float impulse, const PointStep& step) {
  p.normal_impulse += impulse;
  p.apply(impulse * p.normal, step);
  tips_[p.tip].add_load(-impulse * p.normal, -impulse * p.normal);
}

void TipSolver::solve_point(Point& p, float target_speed, const PointStep& step) {
  Tip& tip = tips_[p.tip];
  float impulse = p.normal_impulse_for(target_speed, relative_velocity(p, step));
  const Vec3 others = tip.normal_load + p.normal_impulse * p.normal;
  const bool is_overloaded = (others - impulse * p.normal).squaredNorm() > tip.max_impulse * tip.max_impulse;
  if (is_overloaded) impulse *= greatest_share(others, impulse * p.normal, tip.max_impulse);
  add_normal_impulse(p, impulse - p.normal_impulse, step);
  if (is_overloaded) yield(p, target_speed, step);
  const Vec3 friction = p.solve_friction(relative_velocity(p, step));
  p.apply(friction, step);
  tip.add_load(-friction, Vec3::Zero());
  p.solve_rolling(step);
}

// The joints move with the body, as far as they can.
void TipSolver::yield(Point& p, float target_speed, const PointStep& step) {
  Tip& tip = tips_[p.tip];
  const float deficit = target_speed - p.normal.dot(relative_velocity(p, step));
  if (!(deficit > 0.0F)) return;
  Tip next = tip;
  next.held_position += step.params.h_s * (tip.held_velocity + tip.yield_velocity);
  const float speed = std::min(deficit, next.room_along(-p.normal) * step.params.inverse_h);
  tip.yield_velocity -= speed * p.normal;
  if (speed < deficit) add_normal_impulse(p, p.rigid_mass * (deficit - speed), step);
}

void TipSolver::solve(const PointStep& step, IndexRange islands) {
  for_each_tip(islands, [&](Tip& t) {
    t.yield_velocity.setZero();
    const Mat3 last_response = t.response;
    t.begin_substep(step.params.h_s);
    t.response_changed = t.response != last_response;
  });
  for (Point& p : points_of(islands))
    if (const Tip& t = tips_[p.tip]; t.response_changed) p.set_response(t.response);
  for (Point& p : points_of(islands)) solve_point(p, p.push_out_speed(tips_[p.tip].moved, step), step);
}

void TipSolver::relax(const PointStep& step, IndexRange islands) {
  const float h_s = step.params.h_s;
  classify_loads(islands);
  for_each_tip(islands, [&](Tip& t) {
    const Vec3 rate = t.rate_in_substep(h_s), held = t.held_velocity + t.yield_velocity;
    t.moved += h_s * (held + rate);
    t.yielded += h_s * t.yield_velocity;
    t.held_position += h_s * held;
    t.moved_deflection += h_s * rate;
  });
  for (Point& p : points_of(islands)) {
    solve_point(p, p.relax_target_speed, step);
    p.total_normal_impulse += p.normal_impulse;
  }
  classify_loads(islands);
  for_each_tip(islands, [&](Tip& t) {
    t.rate = t.directions_with_load() * t.deflection_rate();
    t.deflection = t.start_deflection + t.moved_deflection;
  });
}

void TipSolver::classify_loads(IndexRange islands) {
  constexpr float kAtLimit = 0.9999F;
  for_each_tip(islands, [](Tip& t) {
    t.is_loaded = t.sticks = false;
    t.is_overloaded = t.normal_load.norm() >= kAtLimit * t.max_impulse;
  });
  for (const Point& p : points_of(islands)) {
    if (!(p.normal_impulse > 0.0F)) continue;
    Tip& t = tips_[p.tip];
    t.is_loaded = true;
    t.sticks |= p.friction_impulse.norm() < kAtLimit * p.friction * p.normal_impulse;
  }
}

void TipSolver::store(surface::Field& field, ContactList& static_contacts, float dt_s) {
  loaded_cells_.clear(), loaded_rates_.clear();
  for (const Point& p : points_) p.store(static_contacts.contacts[p.contact]);
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    const std::int32_t cell = cells_[k];
    const Tip& t = tips_[k];
    if (t.is_loaded) loaded_cells_.push_back(cell), loaded_rates_.push_back(t.rate);
    surface::YieldingTip& y = field.yielding[cell];
    y.held_velocity = t.held_velocity + t.yielded / dt_s;
    y.deflection_rate = (t.deflection - t.start_deflection) / dt_s;
    const Vec3 velocity = y.held_velocity + y.deflection_rate;
    field.offset_rate[cell] = velocity.head<2>();
    field.speed[cell] = velocity.z();
  }
}

}  // namespace smartsurf::world
