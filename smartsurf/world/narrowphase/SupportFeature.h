// What a convex piece turns towards a direction: a face, an edge or a corner; and where two of these meet.
#pragma once

#include <array>

#include "smartsurf/world/narrowphase/Distance.h"
#include "smartsurf/world/narrowphase/ManifoldReducer.h"

namespace smartsurf::world {

struct SupportFeature {
  static constexpr int kMaxPoints = 24;
  std::array<Vec3, kMaxPoints> point;  // counter-clockwise seen from outside, world frame
  int count = 0;                       // 1: a corner, 2: an edge, more: a face
  Vec3 normal{0, 0, 1};                // of a face: unit, outward
  bool is_face() const { return count > 2; }
  void add(const Vec3& p) {
    if (count < kMaxPoints) point[static_cast<std::size_t>(count++)] = p;
  }
};
// `direction`: unit, world frame.
SupportFeature support_feature(const ConvexPart&, const Vec3& centre, const Mat3& axes,
                               const Vec3& direction);

// A face this much in line with the normal takes part with its whole area.
inline constexpr float kFaceAlignment = 0.99F;
// How much in line with the direction the face is that support_feature gives; 0 where it gives an edge.
float face_alignment(const ConvexPart&, const Mat3& axes, const Vec3& direction);

// Cuts a face or an edge to what lies over a face.
SupportFeature clip_to_face(const SupportFeature& feature, const SupportFeature& face);
// The same for an upright rectangle, seen from above.
SupportFeature clip_to_rectangle(const SupportFeature& feature, float west, float east, float south,
                                 float north);

// Adds the points where two features that face each other along a normal (unit, from b to a) come within the
// margin: the patch that two faces share, the ends of an edge over a face or along another edge. None where
// only a corner or two crossing edges meet. `tag` goes with the points.
void add_contact_patch(const SupportFeature& on_a, const SupportFeature& on_b, const Vec3& normal,
                       float margin, int tag, ManifoldReducer& out);

}  // namespace smartsurf::world
