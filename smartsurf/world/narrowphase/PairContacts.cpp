#include "smartsurf/world/narrowphase/PairContacts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/narrowphase/ConvexPair.h"
#include "smartsurf/world/narrowphase/Distance.h"
#include "smartsurf/world/narrowphase/InternalEdges.h"

namespace smartsurf::world {
namespace {

// Distance by which the bodies approach each other along the normal within one step, u.
float closing_distance(const BodyStore& bodies, std::size_t a, std::size_t b, const Vec3& normal,
                       float dt_s) {
  return std::max(0.0F, -normal.dot(bodies.velocity(a) - bodies.velocity(b))) * dt_s;
}

void collide_spheres(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, float dt_s,
                     std::vector<Contact>& out) {
  const Vec3 offset = bodies.position[a] - bodies.position[b];
  const float distance = offset.norm();
  const Vec3 normal = distance > 1e-6F ? Vec3(offset / distance) : Vec3(0, 0, 1);
  const float separation = distance - bodies.bounding_radius[a] - bodies.bounding_radius[b];
  if (separation > margin && separation > margin + closing_distance(bodies, a, b, normal, dt_s)) return;
  Contact& c = out.emplace_back();
  c.normal = normal;
  c.anchor = -bodies.bounding_radius[a] * normal;
  c.separation = separation;
}

// A sphere and a non-sphere, in either order.
void collide_sphere(const BodyStore& bodies, std::size_t sphere, std::size_t other, bool sphere_is_a,
                    float margin, float dt_s, std::vector<Contact>& out) {
  const float radius = bodies.bounding_radius[sphere];
  const Vec3 centre = bodies.axes[other].transpose() * (bodies.origin(sphere) - bodies.origin(other));
  const float max_distance =
      radius + margin + (bodies.velocity(sphere) - bodies.velocity(other)).norm() * dt_s;
  if ((centre.cwiseAbs() - bodies.shape[other]->half_extents).maxCoeff() > max_distance) return;
  for_each_part(*bodies.shape[other], [&](const ConvexPart& part) {
    const SignedDistance o = signed_distance(part, centre, max_distance);
    const Vec3 normal = bodies.axes[other] * o.normal;
    const float separation = o.distance - radius;
    if (separation > margin && separation > margin + closing_distance(bodies, sphere, other, normal, dt_s))
      return;
    Contact& c = out.emplace_back();
    c.normal = sphere_is_a ? normal : Vec3(-normal);
    c.separation = separation;
    c.anchor = sphere_is_a
                   ? Vec3(-radius * normal)
                   : Vec3(bodies.origin(sphere) - (radius + separation) * normal - bodies.origin(other));
  });
}

Vec3 centre_normal(const BodyStore& bodies, std::size_t a, std::size_t b) {
  const Vec3 offset = bodies.origin(a) - bodies.origin(b);
  const float distance = offset.norm();
  return distance > 1e-6F ? Vec3(offset / distance) : Vec3(0, 0, 1);
}

}  // namespace

float closing_distance(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s) {
  return closing_distance(bodies, a, b, centre_normal(bodies, a, b), dt_s);
}

void collide_bodies(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, float dt_s,
                    const Vec3* cached_normal, std::vector<Contact>& out) {
  const bool sphere_a = bodies.is_sphere[a], sphere_b = bodies.is_sphere[b];
  if (sphere_a && sphere_b) return collide_spheres(bodies, a, b, margin, dt_s, out);
  if (sphere_a) return collide_sphere(bodies, a, b, true, margin, dt_s, out);
  if (sphere_b) return collide_sphere(bodies, b, a, false, margin, dt_s, out);
  collide_convex({*bodies.shape[a], bodies.origin(a), bodies.axes[a]},
                 {*bodies.shape[b], bodies.origin(b), bodies.axes[b]},
                 margin + closing_distance(bodies, a, b, dt_s), cached_normal, out);
}

float fraction_until_contact(const Vec3& distance, float separation, float radii, const Vec3& movement) {
  // |distance + fraction·movement| = radii
  const float half = distance.dot(movement), gap = separation * (separation + 2.0F * radii),
              discriminant = half * half - movement.squaredNorm() * gap;
  if (!(half < 0.0F && discriminant > 0.0F)) return std::numeric_limits<float>::infinity();
  return gap / (std::sqrt(discriminant) - half);
}

void predict_meetings(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s,
                      std::span<Contact> contacts) {
  constexpr float kMinSpeed = 0.2F;  // below it, points stay about where they are, u/s
  const Vec3 relative_velocity = bodies.velocity(a) - bodies.velocity(b),
             distance = bodies.position[a] - bodies.position[b];
  const float radius_a = bodies.bounding_radius[a], radius_b = bodies.bounding_radius[b];
  for (Contact& c : contacts) {
    if (c.separation <= 0.0F) continue;
    const Vec3 anchor = c.anchor + bodies.origin_offset[a];
    const Vec3 turning =
        bodies.angular_velocity(a).cross(anchor) - bodies.angular_velocity(b).cross(distance + anchor);
    const float speed = -c.normal.dot(relative_velocity + turning);
    if (speed < kMinSpeed || c.separation > speed * dt_s) continue;
    if (bodies.is_sphere[a] && bodies.is_sphere[b]) {
      const Vec3 movement = dt_s * relative_velocity;
      const float fraction = fraction_until_contact(distance, c.separation, radius_a + radius_b, movement);
      if (fraction > 1.0F) continue;
      c.normal = (distance + fraction * movement).normalized();
      c.anchor = -radius_a * c.normal;
      c.separation = -fraction * c.normal.dot(movement);
    } else {
      c.anchor_time_s = -c.separation / speed;
    }
  }
}

void move_to_meeting(const BodyStore& bodies, std::size_t a, std::size_t b, Contact& c) {
  if (c.anchor_time_s >= 0.0F) return;
  c.anchor_time_s = -c.anchor_time_s;
  const Vec3 movement = c.anchor_time_s * (bodies.velocity(a) - bodies.velocity(b)),
             aside = movement - c.normal.dot(movement) * c.normal;
  // The point is fixed on a sphere; it may be a corner of either of two other bodies.
  if (!bodies.is_sphere[a]) c.anchor -= bodies.is_sphere[b] ? movement : Vec3(0.5F * aside);
}

void collide_placed(const PlacedShape& a, const PlacedShape& b, float margin, std::vector<Contact>& out) {
  if (!a.shape.is_sphere() && !b.shape.is_sphere()) return void(collide_convex(a, b, margin, nullptr, out));
  const PlacedShape &sphere = a.shape.is_sphere() ? a : b, &other = a.shape.is_sphere() ? b : a;
  const float radius = sphere.shape.bounding_radius, side = a.shape.is_sphere() ? 1.0F : -1.0F;
  const Vec3 centre = other.axes.transpose() * (sphere.centre - other.centre);
  if ((centre.cwiseAbs() - other.shape.half_extents).maxCoeff() > radius + margin) return;
  for_each_part(other.shape, [&](const ConvexPart& part) {
    const SignedDistance d = signed_distance(part, centre, radius + margin);
    if (d.distance > radius + margin) return;
    Contact& c = out.emplace_back();
    const Vec3 normal = other.axes * d.normal;
    c.normal = side * normal;
    c.separation = d.distance - radius;
    c.anchor = a.shape.is_sphere() ? Vec3(-radius * normal)
                                   : Vec3(sphere.centre - d.distance * normal - other.centre);
  });
}

}  // namespace smartsurf::world
