#include "smartsurf/world/field/FieldCollider.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SkinContacts.h"
#include "smartsurf/world/field/TipsOnField.h"

namespace smartsurf::world {

void FieldCollider::collide_columns(const Shape& shape, const Vec3& centre, const Mat3& axes, float margin,
                                    std::vector<Contact>& out) const {
  if (shape.is_sphere())
    collide_sphere_with_columns(centre, shape.bounding_radius, margin, {}, out);
  else if (free_layout_)
    free_layout_->collide(shape, centre, axes, margin, out);
  else
    collide_shape_with_field(field_, shape, centre, axes, margin, out);
}

void FieldCollider::collide_sphere_with_columns(const Vec3& centre, float radius, float margin,
                                                const SphereMotion& motion, std::vector<Contact>& out) const {
  if (free_layout_)
    free_layout_->collide_sphere(centre, radius, margin, motion, out);
  else
    collide_sphere_with_field(field_, centre, radius, margin, out, motion);
}

void FieldCollider::collide_skin_or_tips(const Shape& shape, const Vec3& centre, const Mat3& axes,
                                         float margin, std::vector<Contact>& out) const {
  if (field_.has_skin()) {
    collide_with_skin(field_.skin, shape, centre, axes, margin, out);
    collide_with_pin_below(shape, centre, axes, margin, out);
  } else {
    collide_with_tips(field_, free_layout_.get(), shape, centre, axes, margin, out);
  }
}

// A body whose centre has passed the skin rests on the top of the nearest pin.
void FieldCollider::collide_with_pin_below(const Shape& shape, const Vec3& centre, const Mat3& axes,
                                           float margin, std::vector<Contact>& out) const {
  const surface::Skin& skin = field_.skin;
  if (centre.x() < skin.west || centre.x() > skin.east() || centre.y() < skin.south() ||
      centre.y() > skin.north)
    return;
  const surface::Skin::Location at = skin.locate(centre.x(), centre.y());
  if (centre.z() >= at.interpolate(skin.height)) return;
  const auto nearest = std::max_element(at.weight, at.weight + 3) - at.weight;
  const std::int32_t cell = skin.cell_of_node[at.node[nearest]];
  const float top = field_.height[cell];
  if (!std::isfinite(top) || centre.z() < top) return;
  const std::size_t first = out.size();
  collide_shape_with_ground(shape, centre, axes, top, margin, out);
  for (std::size_t i = first; i < out.size(); ++i) {
    out[i].partner = Partner::kCell, out[i].feature_id = cell;
    out[i].surface_velocity = {0, 0, field_.speed[cell]};
  }
}

bool FieldCollider::may_overlap(const Vec3& low, const Vec3& high) const {
  if (low.z() > field_.max_height) return false;
  if (free_layout_ || has_skin_or_tips()) return true;
  const Columns columns(field_);
  return low.z() <= columns.max_height(columns.cells_covering(low.x(), high.x(), low.y(), high.y()));
}

}  // namespace smartsurf::world
