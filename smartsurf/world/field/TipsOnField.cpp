#include "smartsurf/world/field/TipsOnField.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SphereManifoldReducer.h"
#include "smartsurf/world/narrowphase/ConvexPair.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;
using TipShape = surface::CellTip::Shape;

// How far shafts and columns reach below the body, u.
constexpr float kDepthBelowBody = 1.0F;

Mat3 rotation_of(const surface::TopTilt& tilt, float angle) {
  return (Eigen::AngleAxisf(angle, Vec3::UnitZ()) * Eigen::AngleAxisf(tilt.pitch, Vec3::UnitY()) *
          Eigen::AngleAxisf(tilt.roll, Vec3::UnitX()))
      .toRotationMatrix();
}

// Calls visit(cell) for the cells whose tip may reach into the box, ascending.
template <class Visit>
void for_each_tip(const surface::Field& field, const FreeLayoutField* layout, const Vec3& low,
                  const Vec3& high, Visit visit) {
  const auto visit_tip = [&](std::size_t cell) {
    if (!field.is_column(cell) && std::isfinite(field.height[cell])) visit(cell);
  };
  const Vec3 reach(field.tip_reach, field.tip_reach, 0);
  if (layout != nullptr) {
    thread_local std::vector<std::int32_t> cells;
    layout->find_cells(low - reach, high + reach, cells);
    for (const std::int32_t cell : cells) visit_tip(cell);
    return;
  }
  const auto first = [&](float u) {
    return static_cast<int>(std::ceil(std::clamp(u / field.pitch, -1.0F, 1e6F)));
  };
  const auto last = [&](float u) {
    return static_cast<int>(std::floor(std::clamp(u / field.pitch, -1.0F, 1e6F)));
  };
  const float south = static_cast<float>(field.rows - 1) * field.pitch;
  const int row_end = std::min(field.rows, last(south - low.y() + reach.y()) + 1),
            column_end = std::min(field.columns, last(high.x() + reach.x()) + 1);
  for (int r = std::max(0, first(south - high.y() - reach.y())); r < row_end; ++r)
    for (int c = std::max(0, first(low.x() - reach.x())); c < column_end; ++c) visit_tip(field.index(r, c));
}

// The parts of the kinds of tips that one body meets.
class TipPartsCache {
 public:
  // body_low: the lowest z of the body.
  TipPartsCache(const surface::Field& field, float body_low)
      : field_(field), depth_(std::max(0.0F, field.max_height - body_low) + kDepthBelowBody) {}
  std::span<const TipParts::Part> of(std::size_t cell) {
    const std::int8_t kind = field_.tip_of_cell[cell];
    if (kind != kind_) parts_.emplace(field_, field_.tips[kind], depth_), kind_ = kind;
    return std::span(parts_->part).first(parts_->count);
  }

 private:
  const surface::Field& field_;
  float depth_;
  std::int8_t kind_ = -1;
  std::optional<TipParts> parts_;
};

void finish(const surface::Field& field, const TipFrame& frame, std::size_t cell, const Vec3& point,
            Contact& c) {
  c.partner = field.tip_at(cell).yields() ? Partner::kYieldingTip : Partner::kCell;
  c.feature_id = static_cast<std::int32_t>(cell);
  c.surface_velocity = frame.velocity_at(point);
}

void collide_sphere(const surface::Field& field, const FreeLayoutField* layout, const Vec3& centre,
                    float radius, float margin, std::vector<Contact>& out) {
  const Vec3 reach = Vec3::Constant(radius + margin);
  TipPartsCache parts(field, centre.z() - radius);
  SphereManifoldReducer<Contact> reducer;
  for_each_tip(field, layout, centre - reach, centre + reach, [&](std::size_t cell) {
    const TipFrame frame(field, cell);
    SignedDistance nearest{Vec3::UnitZ(), radius + margin};
    for (const TipParts::Part& part : parts.of(cell)) {
      const Vec3 local = frame.axes.transpose() * (centre - frame.origin) - part.centre;
      const SignedDistance d = signed_distance({part.shape, nullptr}, local);
      if (d.distance < nearest.distance) nearest = {frame.axes * d.normal, d.distance};
    }
    if (nearest.distance >= radius + margin) return;
    Contact c;
    c.normal = nearest.normal;
    c.anchor = -radius * c.normal;
    c.separation = nearest.distance - radius;
    finish(field, frame, cell, centre - nearest.distance * c.normal, c);
    if (field.tip_at(cell).moves_sideways())
      out.push_back(c);
    else
      reducer.add(c);
  });
  reducer.reduce([&out](const Contact& c) { out.push_back(c); });
}

// A spherical tip and a body other than a sphere: one contact with each convex part.
void collide_spherical_tip(const TipFrame& frame, float radius, const PlacedShape& body, float margin,
                           std::vector<Contact>& out) {
  const Vec3 tip_centre = frame.origin - radius * Vec3::UnitZ();
  const Vec3 local = body.axes.transpose() * (tip_centre - body.centre);
  if ((local.cwiseAbs() - body.shape.half_extents).maxCoeff() > radius + margin) return;
  for_each_part(body.shape, [&](const ConvexPart& part) {
    const SignedDistance d = signed_distance(part, local, radius + margin);
    if (d.distance >= radius + margin) return;
    Contact& c = out.emplace_back();
    c.normal = body.axes * -d.normal;
    c.separation = d.distance - radius;
    c.anchor = tip_centre + d.distance * c.normal - body.centre;
  });
}

}  // namespace

TipParts::TipParts(const surface::Field& field, const surface::CellTip& tip, float depth) {
  const float r = tip.radius, h = tip.height, x = field.half_top_x, y = field.half_top_y;
  const auto box = [](float half_x, float half_y, float half_z) {
    return make_primitive(ShapeKind::kBox, 0.0F, 0.0F, {half_x, half_y, half_z});
  };
  const auto round = [r](ShapeKind kind, float height) {
    return make_primitive(kind, r, height, {r, r, 0.5F * height});
  };
  switch (tip.shape) {
    case TipShape::kHemisphere:
      add(round(ShapeKind::kCapsule, depth + 2.0F * r), {0, 0, -0.5F * depth - r});
      break;
    case TipShape::kCone: {
      const Shape cone = make_primitive(ShapeKind::kCone, r, h, {r, r, 0.75F * h});
      add(cone, {0, 0, -cone.high});
      add(round(ShapeKind::kCylinder, depth), {0, 0, -h - 0.5F * depth});
      break;
    }
    case TipShape::kRoundedSquare: {
      const Vec3 centre(0, 0, -0.5F * depth);
      if (y > r) add(box(x, y - r, 0.5F * depth), centre);
      if (x > r) add(box(x - r, y, 0.5F * depth), centre);
      for (const float east : {-1.0F, 1.0F})
        for (const float north : {-1.0F, 1.0F})
          add(round(ShapeKind::kCylinder, depth), centre + Vec3(east * (x - r), north * (y - r), 0));
      break;
    }
    case TipShape::kPlate:
      add(box(x, y, 0.5F * h), {0, 0, -0.5F * h});
      break;
    case TipShape::kSphere:
      add(round(ShapeKind::kSphere, 0.0F), {0, 0, -r});
      break;
    case TipShape::kRoundedCylinder:
      add(round(ShapeKind::kCapsule, h), {0, 0, -0.5F * h});
      break;
    case TipShape::kElasticTop:
      break;  // a column
  }
}

TipFrame::TipFrame(const surface::Field& field, std::size_t cell, float elapsed_s) {
  const auto index = static_cast<int>(cell);
  const Eigen::Vector2f centre = field.centre(index);
  const float angle = field.angle_of(index);
  origin = {centre.x(), centre.y(), field.height[cell] + elapsed_s * field.speed[cell]};
  velocity = {0, 0, field.speed[cell]};
  if (field.has_offset()) {
    const Eigen::Vector2f& rate = field.offset_rate[cell];
    origin.head<2>() += field.offset[cell] + elapsed_s * rate;
    velocity.head<2>() = rate;
  }
  axes = Mat3::Identity();
  angular_velocity = Vec3::Zero();
  surface::TopTilt tilt, rate;
  if (field.has_tilt()) tilt = field.tilt[cell], rate = field.tilt_rate[cell];
  if (angle == 0.0F && tilt.is_zero() && rate.is_zero()) return;
  axes = rotation_of({tilt.roll + elapsed_s * rate.roll, tilt.pitch + elapsed_s * rate.pitch}, angle);
  // The axis of the roll turns with the pitch.
  angular_velocity = rate.pitch * Vec3(-std::sin(angle), std::cos(angle), 0) + rate.roll * Vec3(axes.col(0));
}

void collide_with_tips(const surface::Field& field, const FreeLayoutField* layout, const Shape& shape,
                       const Vec3& centre, const Mat3& axes, float margin, std::vector<Contact>& out) {
  const Vec3 extent = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  if (centre.z() - extent.z() > field.max_height) return;
  if (shape.is_sphere()) return collide_sphere(field, layout, centre, shape.radius, margin, out);
  thread_local std::vector<Contact> contacts, tip_contacts;
  contacts.clear();
  const bool is_reduced = shape.hulls.size() <= 1;
  const PlacedShape body{shape, centre, axes};
  TipPartsCache parts(field, centre.z() - extent.z());
  for_each_tip(field, layout, centre - extent, centre + extent, [&](std::size_t cell) {
    const TipFrame frame(field, cell);
    const surface::CellTip& tip = field.tip_at(cell);
    tip_contacts.clear();
    if (tip.shape == TipShape::kSphere)
      collide_spherical_tip(frame, tip.radius, body, margin, tip_contacts);
    else
      for (const TipParts::Part& part : parts.of(cell)) {
        const Vec3 part_centre = frame.origin + frame.axes * part.centre;
        collide_convex(body, {part.shape, part_centre, frame.axes}, margin, nullptr, tip_contacts);
      }
    for (Contact& c : tip_contacts) finish(field, frame, cell, centre + c.anchor, c);
    std::vector<Contact>& to = is_reduced && !tip.moves_sideways() ? contacts : out;
    to.insert(to.end(), tip_contacts.begin(), tip_contacts.end());
  });
  append_reduced(contacts, out);
}

}  // namespace smartsurf::world
