#include "smartsurf/world/field/ShapeOnGround.h"

#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {

void collide_shape_with_ground(const Shape& shape, const Vec3& centre, const Mat3& axes, float ground_height,
                               float margin, std::vector<Contact>& out) {
  for_each_part(shape, [&](const ConvexPart& part) {
    ManifoldReducer candidates;
    const SupportFeature lowest = support_feature(part, centre, axes, Vec3(0, 0, -1));
    for (int i = 0; i < lowest.count; ++i) {
      const Vec3& p = lowest.point[static_cast<std::size_t>(i)];
      if (p.z() - ground_height <= margin) candidates.add({p, Vec3(0, 0, 1), p.z() - ground_height, 0});
    }
    candidates.reduce([&](const ManifoldCandidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.anchor = c.point - centre;
      contact.separation = c.separation;
      contact.other = kGround;
    });
  });
}

}  // namespace smartsurf::world
