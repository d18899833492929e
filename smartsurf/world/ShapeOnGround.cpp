#include "smartsurf/world/ShapeOnGround.h"

#include "smartsurf/world/Feature.h"

namespace smartsurf::world {

void touch_ground(const Shape& shape, const Vec3& centre, const Mat3& axes, float ground, float margin,
                  std::vector<Contact>& out) {
  for_pieces(shape, [&](const Piece& piece) {
    Candidates candidates;
    const Feature lowest = feature_towards(piece, centre, axes, Vec3(0, 0, -1));
    for (int i = 0; i < lowest.count; ++i) {
      const Vec3& p = lowest.point[static_cast<std::size_t>(i)];
      if (p.z() - ground <= margin) candidates.add({p, Vec3(0, 0, 1), p.z() - ground, 0});
    }
    candidates.pick([&](const Candidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.anchor = c.point - centre;
      contact.separation = c.gap;
      contact.other = kGround;
    });
  });
}

}  // namespace smartsurf::world
