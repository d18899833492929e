// The support feature of a convex part in a direction (a face, an edge or a corner), and clipping of two
// features.
#pragma once

#include <array>

#include "smartsurf/world/narrowphase/Distance.h"
#include "smartsurf/world/narrowphase/ManifoldReducer.h"

namespace smartsurf::world {

struct SupportFeature {
  static constexpr int kMaxPoints = 24;
  std::array<Vec3, kMaxPoints> point;  // counter-clockwise from outside, world frame
  int count = 0;                       // 1: a corner, 2: an edge, more: a face
  Vec3 normal{0, 0, 1};                // of a face: unit, outward
  bool is_face() const { return count > 2; }
  void add(const Vec3& p) {
    if (count < kMaxPoints) point[count++] = p;
  }
};
// `direction`: unit, world frame.
SupportFeature support_feature(const ConvexPart&, const Vec3& centre, const Mat3& axes,
                               const Vec3& direction);

// Cosine of the angle between face and contact normal from which the whole face takes part.
inline constexpr float kFaceAlignment = 0.99F;
// Cosine of the angle between the direction and the face that support_feature() returns; 0 if it returns an
// edge.
float face_alignment(const ConvexPart&, const Mat3& axes, const Vec3& direction);

// The edge of a face that reaches farthest in a direction.
SupportFeature farthest_edge(const SupportFeature& face, const Vec3& direction);

// Clips a face or an edge against the side planes of a face (Sutherland and Hodgman).
SupportFeature clip_to_face(const SupportFeature& feature, const SupportFeature& face);
// The same against an axis-aligned rectangle, in the horizontal plane.
SupportFeature clip_to_rectangle(const SupportFeature& feature, float west, float east, float south,
                                 float north);

// Where the points of a patch lie: on b; or on the incident feature, which is clipped against the reference
// face, and those of parallel edges midway.
enum class PatchPoints { kOnB, kOnIncident };

// Adds the points with separations up to `margin` along the normal (unit, from b to a): the polygon that two
// faces share, or the ends of an edge over a face or along another edge. Adds none for a corner or crossing
// edges.
void add_contact_patch(const SupportFeature& on_a, const SupportFeature& on_b, const Vec3& normal,
                       float margin, PatchPoints, ManifoldReducer& out);

}  // namespace smartsurf::world
