// Contacts of a non-sphere with the field and with the ground below it.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {

// Appends the contacts of each convex part: four at most of those in one plane, the deepest first, then those
// that widen the support. Points in different planes do not stand for each other: which of them bear is for
// the solver to find. Cells are bottomless columns, bridged as for spheres (SphereOnField.h). With a cell of
// a free layout, only the contacts with that one, in its frame and without the velocity of the surface.
void collide_shape_with_field(const surface::Field&, const Shape&, const Vec3& centre, const Mat3& axes,
                              float margin, std::vector<Contact>& out, const FreeCell* = nullptr);

// True for a contact with the side of a column whose top the body's lowest point is just below. Edges are
// round: one that sank a little into a gap rides up on the next top, which then bears it, instead of
// catching.
bool rides_up(const Vec3& normal, float top, float lowest);
// The lowest point of a body, or a bound below it.
float lowest_point(const Shape&, const Vec3& centre, const Mat3& axes);

// Appends the contacts of one body that are left when those of each plane are reduced by themselves.
void append_reduced(std::span<const Contact> contacts, std::vector<Contact>& out);

// A point where a convex part may touch a cell. The candidate's tag is the cell.
struct FieldCandidate {
  ManifoldCandidate candidate;
  int part_index, plane;  // plane: of the part
};
// Appends all points from which collide_shape_with_field() selects, part by part and plane by plane. No cell
// may have a force limit. Returns by how much the face or edge that gave a column's points is nearer to it
// than the part's others, u, at least: those gave none.
float collect_field_candidates(const surface::Field&, const Shape&, const Vec3& centre, const Mat3& axes,
                               float margin, std::vector<FieldCandidate>& out);

// Appends at most eight contacts per convex part (ManifoldReducer) with the plane z = ground_height, with
// separations up to `margin`.
void collide_shape_with_ground(const Shape&, const Vec3& centre, const Mat3& axes, float ground_height,
                               float margin, std::vector<Contact>& out);

}  // namespace smartsurf::world
