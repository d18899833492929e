#include "smartsurf/world/narrowphase/RollingPoints.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "common/memory/Prefetch.h"
#include "smartsurf/world/body/VectorRow.h"

namespace smartsurf::world {
namespace {

// Points are moved along straight lines, up to this angle of the bodies and about their axes, rad.
constexpr float kMaxTurn = 0.5F;
// Normals at less than 45° from the axis are on an end.
constexpr float kEndSine = 0.7F;
// Surfaces that pass their points evenly enough, u/s².
constexpr float kMinAcceleration = 0.01F;

// The curvature of a body's surface at a contact, in the tangent plane.
struct Curvature {
  float value = 0.0F;        // 1/u; 0: flat
  Vec3 flat_along{0, 0, 0};  // unit, the direction without curvature; 0: curved in all
};

// `from_origin`: to the contact point, in world axes.
Curvature curvature_at(const BodyStore& bodies, std::size_t body, const Vec3& from_origin,
                       const Vec3& normal) {
  if (!bodies.is_round(body)) return {};
  const Shape& shape = *bodies.shape[body];
  if (bodies.is_sphere[body]) return {1.0F / shape.radius};
  const Vec3 axis = bodies.axes[body].col(2);
  const float along = from_origin.dot(axis), normal_along = normal.dot(axis);
  // A speculative contact of a body that spins fast may lie far from it.
  constexpr float kNear = 2.0F;
  const float from_axis = (from_origin - along * axis).norm();
  if (from_axis > kNear * shape.radius) return {};
  // On an edge or a corner of what it touches the normal is not across the axis.
  const auto generatrix = [&] { return Vec3((axis - normal_along * normal).normalized()); };
  if (shape.kind == scene::ShapeKind::kCapsule) {
    const float end = std::max(0.0F, shape.high - shape.radius);
    if (std::abs(along) < end) return {1.0F / shape.radius, generatrix()};
    return {1.0F / shape.radius};
  }
  const Vec3 across = normal - normal_along * axis;
  // The lowest point of a surface of revolution, or of a rim, rolls over it. The other points of an end stay,
  // as do all where it stands on it.
  constexpr float kStandingHeight = 4e-3F, kLowest = 0.9F, kRim = 0.98F, kTip = 0.1F;
  const float steepness = across.norm();
  if (2.0F * shape.radius * steepness < kStandingHeight) return {};
  if (from_axis > kTip * shape.radius && across.dot(from_origin) > -kLowest * steepness * from_axis)
    return {};
  const bool is_cone = shape.kind == scene::ShapeKind::kCone;
  // A cone that stands on its tip turns about it.
  constexpr float kOnSide = 0.98F;
  const float length = shape.high - shape.low;
  if (is_cone && from_axis <= kTip * shape.radius &&
      steepness * std::hypot(length, shape.radius) < kOnSide * length)
    return {};
  const bool faces_end = is_cone ? normal_along > 0.0F : steepness < kEndSine;
  if (faces_end && from_axis < kRim * shape.radius) return {};
  constexpr float kMinRadius = 1e-4F;  // of a cone, near its tip
  return {steepness / std::max(kMinRadius, from_axis), generatrix()};
}

// One of the two bodies, or the ground. The last components of rows do not count.
struct Side {
  Float4 velocity{}, angular_velocity{}, centre{};  // of mass

  Side() = default;
  Side(const BodyStore& bodies, std::size_t body)
      : velocity(load4(bodies.body_velocity[body].velocity)),
        angular_velocity(load4(bodies.body_velocity[body].angular_velocity)),
        centre(to_row(bodies.position[body])) {}
  Float4 velocity_at(const Float4& point) const { return velocity + cross(angular_velocity, point - centre); }
};

// What it reads, for all bodies of a pile, is more than the caches hold.
void prefetch_gyroscopic_acceleration(const BodyStore& bodies, std::size_t body) {
  if (bodies.is_sphere[body] || bodies.is_static(body)) return;
  common::prefetch(&bodies.rotation_state[body].momentum[0]);
  common::prefetch(&bodies.rotation_state[body].momentum[2]);
  common::prefetch(&bodies.world_inverse_inertia[body]);
}

// The angular acceleration without torque, rad/s². Velocities have it from the end of the step on.
Vec3 gyroscopic_acceleration(const BodyStore& bodies, std::size_t body) {
  if (bodies.is_sphere[body] || bodies.is_static(body)) return Vec3::Zero();
  const double* const momentum = bodies.rotation_state[body].momentum;
  const Vec3 torque =
      Eigen::Map<const Eigen::Vector3d>(momentum).cast<float>().cross(bodies.angular_velocity(body));
  return to_matrix(bodies.world_inverse_inertia[body]) * torque;
}

// Velocity of a contact point, u/s, which its normal, from b to a, and the curvatures determine. In a
// direction in which both sides are flat it follows the body a or b. `at_a`, `at_b`: velocities of the bodies
// there; `spin`: of a relative to b.
Float4 velocity_of_point(const Float4& at_a, const Float4& at_b, const Float4& spin, const Curvature& of_a,
                         const Curvature& of_b, const Vec3& normal, bool follows_b) {
  const Float4 turn = cross(spin, to_row(normal));
  // A ball on a flat face.
  if (of_b.value == 0.0F && of_a.flat_along.isZero(0.0F)) return at_a + turn / of_a.value;
  if (of_a.value == 0.0F && of_b.flat_along.isZero(0.0F)) return at_b + turn / of_b.value;
  const Float4 slip = at_a - at_b;
  const Vec3 tangent = normal.unitOrthogonal();
  const Float4 t = to_row(tangent), u = cross(to_row(normal), t);
  const Eigen::Vector2f slip_2(dot(slip, t), dot(slip, u));
  const auto matrix = [&](const Curvature& c) -> Eigen::Matrix2f {
    const Float4 flat_along = to_row(c.flat_along);
    const Eigen::Vector2f flat(dot(flat_along, t), dot(flat_along, u));
    return c.value * (Eigen::Matrix2f::Identity() - flat * flat.transpose());
  };
  const Eigen::Matrix2f k_b = matrix(of_b), k = matrix(of_a) + k_b;
  const Eigen::Vector2f change = Eigen::Vector2f(dot(turn, t), dot(turn, u)) - k_b * slip_2;
  constexpr float kFlat = 1e-3F;
  const float trace = k.trace();
  Eigen::Vector2f over_a;  // of the point over a's surface
  if (k.determinant() > kFlat * trace * trace) {
    over_a = k.inverse() * change;
  } else {
    const Eigen::Vector2f curved = (k(0, 0) > k(1, 1) ? k.col(0) : k.col(1)).normalized(),
                          flat(-curved.y(), curved.x());
    over_a = (curved.dot(change) / trace) * curved;
    if (follows_b) over_a -= flat.dot(slip_2) * flat;
  }
  return at_a + over_a.x() * t + over_a.y() * u;
}

}  // namespace

void move_rolling_points(const BodyStore& bodies, std::size_t a, std::optional<std::size_t> b, float time_s,
                         std::span<Contact> contacts) {
  prefetch_gyroscopic_acceleration(bodies, a);
  if (b) prefetch_gyroscopic_acceleration(bodies, *b);
  const Side side_a(bodies, a), side_b = b ? Side(bodies, *b) : Side();
  const Float4 spin = side_a.angular_velocity - side_b.angular_velocity;
  const float turn_squared = dot(spin, spin);
  const bool follows_b = b && !bodies.is_static(*b) && bodies.bounding_radius[*b] < bodies.bounding_radius[a];
  const Vec3 origin_a = bodies.origin(a), origin_b = b ? bodies.origin(*b) : Vec3(Vec3::Zero());
  std::optional<Float4> gyroscopic_a, gyroscopic_b;
  for (Contact& c : contacts) {
    if (c.anchor_time_s != 0.0F) continue;  // it is elsewhere already
    const Vec3 point = origin_a + c.anchor;
    const Curvature of_a = curvature_at(bodies, a, c.anchor, c.normal);
    const Curvature of_b = b ? curvature_at(bodies, *b, point - origin_b, -c.normal) : Curvature();
    if (of_a.value + of_b.value == 0.0F) continue;
    const Float4 at = to_row(point), at_a = side_a.velocity_at(at), at_b = side_b.velocity_at(at),
                 velocity = velocity_of_point(at_a, at_b, spin, of_a, of_b, c.normal, follows_b);
    const bool a_is_round = of_a.value > 0.0F;
    const Float4 over_round = velocity - (a_is_round ? at_a : at_b);
    const float radius = bodies.shape[a_is_round ? a : *b]->radius,
                speed_squared = dot(over_round, over_round);
    float share = 1.0F;
    // Most turn less by far, which needs no roots.
    constexpr float kSmallTurn = 0.99F * kMaxTurn;
    if (!(time_s * time_s * std::max(turn_squared * radius * radius, speed_squared) <
          kSmallTurn * kSmallTurn * radius * radius)) {
      const float angle = time_s * std::max(std::sqrt(turn_squared), std::sqrt(speed_squared) / radius);
      if (angle > kMaxTurn) share = kMaxTurn / angle;
    }
    const Float4 past_a = velocity - side_a.velocity, past_b = velocity - side_b.velocity;
    c.anchor_time_s = share * time_s;
    c.anchor += c.anchor_time_s * from_row(past_a);
    if (!gyroscopic_a) {
      gyroscopic_a = to_row(gyroscopic_acceleration(bodies, a));
      gyroscopic_b = b ? to_row(gyroscopic_acceleration(bodies, *b)) : Float4{};
    }
    const Float4 gain = share *
                        (cross(side_b.angular_velocity, past_b) - cross(side_a.angular_velocity, past_a)),
                 acceleration = gain + share * (cross(*gyroscopic_b, at - side_b.centre) -
                                                cross(*gyroscopic_a, at - side_a.centre));
    if (dot(acceleration, acceleration) < kMinAcceleration * kMinAcceleration) continue;
    c.surface_velocity -= c.anchor_time_s * from_row(gain);
    c.surface_acceleration = from_row(acceleration);
  }
}

}  // namespace smartsurf::world
