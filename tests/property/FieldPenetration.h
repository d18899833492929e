// The depth by which a convex shape enters the cells of a field, from sample points and closed forms,
// independently of the engine's narrow phase.
#pragma once

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/Shape.h"

namespace physics_fixture {

// The deepest point, u; 0 if the shape touches no cell. `object`: index in the snapshot.
double penetration_into_field(const smartsurf::surface::Field&, const smartsurf::world::Shape&,
                              const smartsurf::scene::Snapshot&, std::size_t object);

// Lowers the shape, from `high` to `low` at most, until it is `wanted` deep. Returns its depth, which is less
// where it jumps: where an upright side meets a top.
double lower_into_field(const smartsurf::surface::Field&, const smartsurf::world::Shape&, float low,
                        float high, double wanted, smartsurf::scene::Snapshot&, std::size_t object);

// An estimate of the distance from the shape to the nearest top, u; not positive if it touches one.
double distance_to_field(const smartsurf::surface::Field&, const smartsurf::world::Shape&,
                         const smartsurf::scene::Snapshot&, std::size_t object);

// Estimate of the depth by which two shapes overlap, u.
double overlap(const smartsurf::world::Shape& a, const smartsurf::world::Shape& b,
               const smartsurf::scene::Snapshot&, std::size_t object_a, std::size_t object_b);

}  // namespace physics_fixture
