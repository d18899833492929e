// Where a body that is no sphere touches the field.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Shape.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {

// Appends at most four contacts for each convex piece, chosen to hold it: the deepest first, then those that
// widen the support. Cells are bottomless columns, bridged as for spheres (SphereOnField.h).
void collide_shape_with_field(const surface::Field&, const Shape&, const Vec3& centre, const Mat3& axes,
                              float margin, std::vector<Contact>& out);

// A point where a convex piece may bear on a cell, which is the candidate's tag. Pieces count from 0.
struct FieldCandidate {
  ManifoldCandidate candidate;
  int part_index;
};
// Appends all points from which collide_shape_with_field would choose, piece by piece. No cell may give way.
void collect_field_candidates(const surface::Field&, const Shape&, const Vec3& centre, const Mat3& axes,
                              float margin, std::vector<FieldCandidate>& out);

}  // namespace smartsurf::world
