// Where a convex object touches the field of pins: grid arithmetic and closed forms, no body per pin.
//
// A pin is a bottomless column with a rectangular top. Two neighbours whose tops are level are bridged: the gap
// between them belongs half to each, and no contact may lean out over a bridged side. So a level field is one flat
// plane, on which nothing snags; an object too small to bridge a gap falls into it.
#pragma once

#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <LinearMath/btTransform.h>

#include <array>
#include <cstdint>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

struct FieldContact {
  btVector3 point;   // on the field, world frame
  btVector3 normal;  // from the field towards the object
  float distance;    // negative: depth of penetration
  std::int32_t cell;
};

// Contacts of one object, at most four, chosen to hold it: the deepest first, then those that widen the support.
struct FieldContactSet {
  std::array<FieldContact, 4> contact;
  int count = 0;
};

// `margin`: contacts up to that distance are found before they touch (speculative contacts), ≥ 0.
// `shape` is the object's Bullet shape, used for edges against edges only. Does not allocate.
FieldContactSet find_field_contacts(const surface::Field&, const scene::ObjectSpec&, const btConvexShape& shape,
                                    const btTransform& pose, float margin);

}  // namespace smartsurf::world
