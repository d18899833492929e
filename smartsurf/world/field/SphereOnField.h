// Contacts of a sphere with the field, in closed form.
//
// A cell is a bottomless column with a rectangular top. Neighbours with level tops are bridged across
// a small gap (Columns.h): each owns half of it, and no contact normal may lean over a bridged side. A level
// field is then one flat plane without internal edges. A sphere rests on the edges of wider gaps, or falls
// into them.
#pragma once

#include <vector>

#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/Columns.h"

namespace smartsurf::world {

// Appends at most four contacts, chosen by SphereManifoldReducer, with separations up to `margin` ≥ 0. Where
// the sphere meets a column within dt_s, the contact's plane is that of the impact.
void collide_sphere_with_field(const surface::Field&, const Vec3& centre, float radius, float margin,
                               std::vector<Contact>& out, const Vec3& velocity = Vec3::Zero(),
                               float dt_s = 0.0F);

// Sets surface_velocity and surface_spin of a contact from its cell, at `point`. The normal must be set.
void set_surface_velocity(const Columns&, int row, int column, const Vec3& point, Contact&);

}  // namespace smartsurf::world
