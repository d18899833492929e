// Contacts of a body with the tips of cells (surface::CellTip), which are convex parts that move rigidly.
#pragma once

#include <array>
#include <vector>

#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/FreeLayoutField.h"

namespace smartsurf::world {

// A tip as a union of convex parts.
struct TipParts {
  struct Part {
    Shape shape;
    Vec3 centre;  // in the tip's axes, from its origin, u
  };
  std::array<Part, 6> part;
  int count = 0;

  // `depth`: of what is bottomless, u, at least the tip's own height.
  TipParts(const surface::Field&, const surface::CellTip&, float depth);

 private:
  void add(const Shape& shape, const Vec3& centre) { part[count++] = {shape, centre}; }
};

// The pose of a cell's tip, world frame.
struct TipFrame {
  Vec3 origin;  // u
  Mat3 axes;
  Vec3 velocity, angular_velocity;  // u/s, rad/s

  // elapsed_s: since the start of the step. Precondition: the cell has a tip.
  TipFrame(const surface::Field&, std::size_t cell, float elapsed_s = 0.0F);
  Vec3 velocity_at(const Vec3& point) const { return velocity + angular_velocity.cross(point - origin); }
};

// Appends the contacts with separations up to `margin` ≥ 0. A sphere has at most four
// (SphereManifoldReducer), another convex body up to eight for each plane (ManifoldReducer), chosen among
// those of all tips; a body of several convex parts has as many for each pair of parts. Contacts with tips
// that move sideways are kept in addition, because each pushes in a direction of its own. Cost: proportional
// to the tips near the body. `layout`: null for a rectangular one.
void collide_with_tips(const surface::Field&, const FreeLayoutField* layout, const Shape&, const Vec3& centre,
                       const Mat3& axes, float margin, std::vector<Contact>& out);

}  // namespace smartsurf::world
