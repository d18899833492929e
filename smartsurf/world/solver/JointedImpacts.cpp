// Impacts of bodies with joints: a blow to one of them moves all that joints connect, and their limits stop.
#include <algorithm>
#include <array>
#include <limits>

#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/ImpactSolver.h"

namespace smartsurf::world {

// Replaces the masses of a point of which a side has joints.
void ImpactSolver::add_responses(const Step& step, Point& p) {
  if (p.stop >= 0) return add_response_of_stop(step, p);
  const std::int32_t body[2] = {p.a, p.b};
  std::int32_t tree[2] = {-1, -1};
  for (const int side : {0, 1})
    if (body[side] >= 0 && step.bodies.is_jointed[body[side]])
      tree[side] = step.joints.tree_of_moving(body[side]);
  if (tree[0] < 0 && tree[1] < 0) return;
  Vec3 velocity[3];  // of a relative to b, by a unit impulse along each axis
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 impulse = from_row(p.axis[axis]);
    const auto blow = [&](int side) {
      return side == 0 ? step.joints.blow_at(p.a, from_row(p.anchor_a), impulse)
                       : step.joints.blow_at(p.b, from_row(p.anchor_b), -impulse);
    };
    row_changes_.clear();
    if (tree[0] == tree[1])
      step.joints.respond(tree[0], std::array{blow(0), blow(1)}, row_changes_);
    else
      for (const int side : {0, 1}) {
        if (tree[side] >= 0)
          step.joints.respond(tree[side], std::array{blow(side)}, row_changes_);
        else if (body[side] >= 0 && (side == 0 ? p.velocity_a : p.velocity_b)->inverse_mass > 0.0F)
          row_changes_.push_back(response_alone(p, side, axis));
      }
    take_row_changes(step, p, axis);
    velocity[axis].setZero();
    for (const JointSolver::RowChange& c : row_changes_) {
      if (c.body == p.a) velocity[axis] += c.velocity + c.angular_velocity.cross(from_row(p.anchor_a));
      if (c.body == p.b) velocity[axis] -= c.velocity + c.angular_velocity.cross(from_row(p.anchor_b));
    }
  }
  const auto along = [&](int i, int j) { return from_row(p.axis[i]).dot(velocity[j]); };
  // Symmetric but for how far the bodies turned within the step.
  set_masses(p, along(0, 0), along(1, 1), along(2, 2), 0.5F * (along(1, 2) + along(2, 1)));
}

void ImpactSolver::add_response_of_stop(const Step& step, Point& p) {
  const JointSolver::Stop& stop = stops_[p.stop];
  row_changes_.clear();
  step.joints.respond(stop.tree, step.joints.blows_of(stop, 1.0F), row_changes_);
  take_row_changes(step, p, 0);
  float speed = 0.0F;
  for (const JointSolver::RowChange& c : row_changes_) {
    if (c.body == stop.a) speed += stop.linear.dot(c.velocity) + stop.turn_a.dot(c.angular_velocity);
    if (c.body == stop.b) speed -= stop.linear.dot(c.velocity) + stop.turn_b.dot(c.angular_velocity);
  }
  p.normal_mass = law::inverse(speed);
}

// Takes row_changes_ as the point's responses to a unit impulse along the axis.
void ImpactSolver::take_row_changes(const Step& step, Point& p, int axis) {
  if (axis == 0) {
    p.first_response = static_cast<std::int32_t>(responses_.size());
    p.response_count = static_cast<std::int32_t>(row_changes_.size());
    for (const JointSolver::RowChange& c : row_changes_)
      responses_.push_back({step.velocity + c.row, &state_of_row(c.row), c.body, c.row, {}, {}});
  }
  for (std::int32_t i = 0; i < p.response_count; ++i) {
    Response& r = responses_[p.first_response + i];
    r.linear[axis] = to_row(row_changes_[i].velocity);
    r.spin[axis] = to_row(row_changes_[i].angular_velocity);
  }
}

// Limits stop joints that the blow moves beyond them, as contacts without restitution resist it.
void ImpactSolver::add_stops(const Step& step) {
  constexpr float kStoppedShare = 1e-3F;  // of the speed of the blow
  struck_trees_.clear();
  for (const std::int32_t body : struck_)
    if (step.bodies.is_jointed[body])
      if (const std::int32_t tree = step.joints.tree_of_moving(body); tree >= 0)
        struck_trees_.push_back(tree);
  std::ranges::sort(struck_trees_);
  const auto [end, last] = std::ranges::unique(struck_trees_);
  struck_trees_.erase(end, last);
  found_stops_.clear();
  for (const std::int32_t tree : struck_trees_) step.joints.find_stops(tree, found_stops_);
  for (const JointSolver::Stop& stop : found_stops_) {
    if (std::ranges::find(stops_, stop.joint, &JointSolver::Stop::joint) != stops_.end()) continue;
    Point p = make_stop(step, stop);
    const float blow_speed = blow_speed_[stop.a], speed = p.velocity_before[0];
    if (speed >= -kStoppedShare * blow_speed || stop.room > step.touching_separation(speed)) continue;
    p.stop = static_cast<std::int32_t>(stops_.size());
    stops_.push_back(stop);
    set_target(p, 0.0F, blow_speed);
    add_point(step, p);
  }
}

ImpactSolver::Point ImpactSolver::make_stop(const Step& step, const JointSolver::Stop& stop) {
  const auto row_of = [&](std::int32_t body) { return body >= 0 ? step.partition.row(body) : -1; };
  const std::int32_t row_a = row_of(stop.a), row_b = row_of(stop.b);
  Point p(step.velocity + row_a, row_b >= 0 ? step.velocity + row_b : nullptr);
  p.stop = 0;
  p.contact = nullptr;
  p.a = stop.a, p.b = stop.b, p.row_a = row_a, p.row_b = row_b;
  p.state_a = &state_of_row(row_a), p.state_b = row_b >= 0 ? &state_of_row(row_b) : nullptr;
  p.axis[0] = to_row(stop.linear);
  p.anchor_a = to_row(stop.turn_a), p.anchor_b = to_row(stop.turn_b);
  p.friction = 0.0F;
  p.max_impulse = std::numeric_limits<float>::infinity();
  p.velocity_before = p.velocity_along_axes();
  p.impulse = Vec3::Zero();
  p.energy_budget = 0.0F;
  p.seen_normal = p.seen_friction = versions(p) - 1;
  return p;
}

// The response of a side without joints that move, to a unit impulse.
JointSolver::RowChange ImpactSolver::response_alone(const Point& p, int side, int axis) {
  const float sign = side == 0 ? 1.0F : -1.0F;
  return {side == 0 ? p.a : p.b, side == 0 ? p.row_a : p.row_b,
          sign * (side == 0 ? p.velocity_a : p.velocity_b)->inverse_mass * from_row(p.axis[axis]),
          sign * from_row(side == 0 ? p.spin_a[axis] : p.spin_b[axis])};
}

// So that joints report the impulses of the blow.
void ImpactSolver::add_blows_to_joints(const Step& step) {
  for (const Point& p : points_) {
    if (p.response_count == 0) continue;
    if (p.stop >= 0) {
      step.joints.add_stop(stops_[p.stop], p.impulse[0]);
      continue;
    }
    Vec3 impulse = Vec3::Zero();
    for (int i = 0; i < 3; ++i) impulse += p.impulse[i] * from_row(p.axis[i]);
    const auto add = [&](std::int32_t body, const Float4& anchor, const Vec3& on_body) {
      const std::int32_t tree = body >= 0 ? step.joints.tree_of_moving(body) : -1;
      if (tree >= 0)
        step.joints.add_blows(tree, std::array{step.joints.blow_at(body, from_row(anchor), on_body)});
    };
    add(p.a, p.anchor_a, impulse), add(p.b, p.anchor_b, -impulse);
  }
}

}  // namespace smartsurf::world
