#include "smartsurf/world/narrowphase/PairContacts.h"

#include <algorithm>
#include <cmath>

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
