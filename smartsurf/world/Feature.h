// What a convex piece turns towards a direction: a face, an edge or a corner; and where two of these meet.
#pragma once

#include <array>

#include "smartsurf/world/Candidates.h"
#include "smartsurf/world/Distance.h"

namespace smartsurf::world {

struct Feature {
  static constexpr int kMost = 24;
  std::array<Vec3, kMost> point;  // counter-clockwise seen from outside, world frame
  int count = 0;                  // 1: a corner, 2: an edge, more: a face
  Vec3 normal{0, 0, 1};           // of a face: unit, outward
  bool flat() const { return count > 2; }
  void add(const Vec3& p) {
    if (count < kMost) point[static_cast<std::size_t>(count++)] = p;
  }
};
// `direction`: unit, world frame.
Feature feature_towards(const Piece&, const Vec3& centre, const Mat3& axes, const Vec3& direction);

// A face this much in line with the normal takes part with its whole area.
inline constexpr float kAligned = 0.99F;
// How much in line with the direction the face is that feature_towards gives; 0 where it gives an edge.
float flatness_towards(const Piece&, const Mat3& axes, const Vec3& direction);

// Cuts a face or an edge to what lies over a face.
Feature clipped(const Feature& what, const Feature& face);
// The same for an upright rectangle, seen from above.
Feature over_rectangle(const Feature& what, float west, float east, float south, float north);

// Adds the points where two features that face each other along a normal (unit, from b to a) come within the
// margin: the patch that two faces share, the ends of an edge over a face or along another edge. None where
// only a corner or two crossing edges meet. `tag` goes with the points.
void add_patch(const Feature& on_a, const Feature& on_b, const Vec3& normal, float margin, int tag,
               Candidates& out);

}  // namespace smartsurf::world
