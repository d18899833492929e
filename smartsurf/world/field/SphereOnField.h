// Contacts of a sphere with the field, in closed form.
//
// A cell is a bottomless column with a rectangular top. Neighbours with level tops are bridged across
// a small gap (Columns.h): each owns half of it, and no contact normal may lean over a bridged side. A level
// field is then one flat plane without internal edges. A sphere rests on the edges of wider gaps, or falls
// into them.
#pragma once

#include <optional>
#include <vector>

#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/field/SphereManifoldReducer.h"

namespace smartsurf::world {

// The motion of a sphere in a step. Where it meets a column within dt_s, the contact's plane is that of the
// impact.
struct SphereMotion {
  Vec3 velocity = Vec3::Zero();
  float dt_s = 0.0F;

  // Relative to the cell's top.
  Vec3 over(const surface::Field& f, Index cell) const {
    return dt_s * (velocity - Vec3(0, 0, f.speed[cell]));
  }
};

// Appends at most four contacts, chosen by SphereManifoldReducer, with separations up to `margin` ≥ 0.
void collide_sphere_with_field(const surface::Field&, const Vec3& centre, float radius, float margin,
                               std::vector<Contact>& out, const SphereMotion& = {});

struct SphereContact : Contact {
  float order;  // ascending: the columns that the sphere meets in the step, then those that it passes
};
using SphereContactReducer = SphereManifoldReducer<SphereContact, &SphereContact::order>;
// The contact with a cell of a free layout, if there is any, in the cell's frame and without the velocity of
// the surface.
std::optional<SphereContact> collide_sphere_with_cell(const surface::Field&, const FreeCell&,
                                                      const Vec3& centre, float radius, float margin,
                                                      const SphereMotion&);

// Sets surface_velocity and surface_spin of a contact from its cell, at `point`, world frame. The normal must
// be set.
void set_surface_velocity(const surface::Field&, const Vec3& point, Contact&);

}  // namespace smartsurf::world
