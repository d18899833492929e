// Contacts of any shape with the field: its columns, and the skin over them or the tips on them.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/FreeLayoutField.h"

namespace smartsurf::world {

class FieldCollider {
 public:
  // `field` must outlive the object, and its layout must not change.
  explicit FieldCollider(const surface::Field& field) : field_(field) {
    if (!field.is_rectangular()) free_layout_ = std::make_unique<FreeLayoutField>(field);
  }

  // Null for a rectangular layout.
  const FreeLayoutField* free_layout() const { return free_layout_.get(); }
  // These append the contacts with separations up to `margin`: with columns, those of a sphere that moves,
  // with the skin or the tips, with all.
  void collide_columns(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                       std::vector<Contact>& out) const;
  void collide_sphere_with_columns(const Vec3& centre, float radius, float margin, const SphereMotion&,
                                   std::vector<Contact>& out) const;
  void collide_skin_or_tips(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                            std::vector<Contact>& out) const;
  void collide(const Shape& shape, const Vec3& centre, const Mat3& axes, float margin,
               std::vector<Contact>& out) const {
    collide_columns(shape, centre, axes, margin, out);
    if (has_skin_or_tips()) collide_skin_or_tips(shape, centre, axes, margin, out);
  }
  bool has_skin_or_tips() const { return field_.has_skin() || field_.has_tips(); }
  // False only if nothing of the field overlaps the box.
  bool may_overlap(const Vec3& low, const Vec3& high) const;
  float min_half_top() const { return std::min(field_.half_top_x, field_.half_top_y); }

 private:
  void collide_with_pin_below(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                              std::vector<Contact>& out) const;

  const surface::Field& field_;
  std::unique_ptr<FreeLayoutField> free_layout_;
};

}  // namespace smartsurf::world
