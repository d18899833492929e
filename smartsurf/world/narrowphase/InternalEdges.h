// Internal edges: avoids ghost collisions where a face of one part continues in a level face of another. A
// contact there must have the normal of the common plane.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

// A shape whose convex parts may continue each other's faces and those of other solids.
struct Solid {
  const Shape& shape;
  Vec3 centre;
  const Mat3& axes;
};
// A contact of a body with one of the solids, the point from which its anchor is measured, and where the
// body's origin is when the contact is as it says.
struct SeamContact {
  Contact* contact;
  Vec3 from, origin;
};

// The separation of a spare contact, in whose place another one bears.
inline constexpr float kSpareSeparation = std::numeric_limits<float>::infinity();

// True if a face of the shape may continue that of another one at a point in its axes.
bool may_continue(const Shape&, const Vec3& point);
// Bounds the distance from the origin of the points at which it may, u.
float greatest_continued_distance(const Shape&);
// A single convex part has no internal edges.
bool may_have_internal_edges(std::span<const Solid>);
// Gives contacts on internal edges the normal of the plane, or marks them as spare if another
// contact has that normal, or if the body is round and another part bears its lowest line. The contacts are
// all those of a body with the solids. `axes`: the body's. `are_b`: the normals point away from the solids.
void mark_internal_edges(std::span<const Solid>, bool are_b, const Shape& body, const Mat3& axes,
                         std::span<const SeamContact>);
// Does both for the contacts from `first` on, which are all those of two bodies, with anchors from the origin
// of a. Returns whether any was erased.
bool correct_internal_edges(const Solid& a, const Solid& b, std::vector<Contact>&, std::size_t first);
// Erases the spare contacts from `first` on.
void erase_spare(std::vector<Contact>&, std::size_t first);

}  // namespace smartsurf::world
