#include "smartsurf/world/FieldContacts.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <limits>

#include "smartsurf/world/Columns.h"

namespace smartsurf::world {
namespace {

// A normal that leans less than this out over a bridged side is taken as leaning by rounding only.
constexpr float kLeanTolerance = 0.05F;

// ---- spheres --------------------------------------------------------------------------------------------------

// Keeps the deepest contact of each compass quadrant and the one straight below: what wedges a sphere in a pocket
// from all sides, where the four deepest alone may all stand on one side.
class QuadrantPicker {
 public:
  void offer(const FieldContact& c) {
    const bool below = c.normal.z() > 0.9999F;
    const int slot = below ? 4 : (c.normal.x() >= 0 ? 1 : 0) + (c.normal.y() >= 0 ? 2 : 0);
    if (!used_[slot] || c.distance < best_[slot].distance) best_[slot] = c, used_[slot] = true;
  }
  FieldContactSet pick() const {
    FieldContactSet set;
    int skip = -1;
    if (used_[0] && used_[1] && used_[2] && used_[3] && used_[4]) {
      skip = 0;
      for (int i = 1; i < 5; ++i)
        if (best_[i].distance > best_[skip].distance) skip = i;
    }
    for (int i = 0; i < 5; ++i)
      if (used_[i] && i != skip) set.contact[static_cast<std::size_t>(set.count++)] = best_[i];
    return set;
  }

 private:
  FieldContact best_[5];
  bool used_[5] = {};
};

FieldContactSet sphere_contacts(const Columns& columns, float radius, const btVector3& centre, float margin) {
  const float reach = radius + margin;
  const CellRange cells =
      columns.covering(centre.x() - reach, centre.x() + reach, centre.y() - reach, centre.y() + reach);
  QuadrantPicker picker;
  for (int r = cells.row_begin; r < cells.row_end; ++r)
    for (int c = cells.column_begin; c < cells.column_end; ++c) {
      if (columns.top(r, c) < centre.z() - reach) continue;
      const Column q = columns.at(r, c);
      const btVector3 nearest(std::clamp(centre.x(), q.west, q.east), std::clamp(centre.y(), q.south, q.north),
                              std::min(centre.z(), q.top));
      const btVector3 offset = centre - nearest;
      const float square = offset.length2();
      if (square > reach * reach) continue;
      if (square > 1e-12F) {
        // Out over a bridged side the neighbour is nearer: its contact is the true one.
        if (q.leans_over_bridge(offset.x(), offset.y(), 0.0F)) continue;
        const float length = std::sqrt(square);
        picker.offer({nearest, offset / length, length - radius, columns.index(r, c)});
      } else {
        const WayOut out = way_out(q, centre);
        picker.offer({centre - out.normal * out.distance, out.normal, out.distance - radius, columns.index(r, c)});
      }
    }
  return picker.pick();
}

// ---- boxes and cylinders ----------------------------------------------------------------------------------------

// A fixed-size list of candidates, from which the four that hold the object best are chosen.
class Candidates {
 public:
  void add(const FieldContact& c) {
    if (count_ < kCapacity) {
      list_[count_++] = c;
      return;
    }
    // Full: the shallowest gives way.
    int worst = 0;
    for (int i = 1; i < kCapacity; ++i)
      if (list_[i].distance > list_[worst].distance) worst = i;
    if (c.distance < list_[worst].distance) list_[worst] = c;
  }

  // The deepest, the one farthest from it, the one farthest from their line, and the one that widens it most.
  FieldContactSet pick() const {
    FieldContactSet set;
    if (count_ == 0) return set;
    int chosen[4];
    chosen[0] = 0;
    for (int i = 1; i < count_; ++i)
      if (list_[i].distance < list_[chosen[0]].distance) chosen[0] = i;
    int n = 1;
    for (; n < 4; ++n) {
      int best = -1;
      float widest = 1e-6F;
      for (int i = 0; i < count_; ++i) {
        const float gain = spread(list_[i].point, chosen, n) - std::max(0.0F, list_[i].distance);
        if (gain > widest) widest = gain, best = i;
      }
      if (best < 0) break;
      chosen[n] = best;
    }
    for (int i = 0; i < n; ++i) set.contact[static_cast<std::size_t>(i)] = list_[chosen[i]];
    set.count = n;
    return set;
  }

 private:
  // How far p lies from the points chosen so far: from the point, from the line, from the nearest corner.
  float spread(const btVector3& p, const int* chosen, int n) const {
    const btVector3& a = list_[chosen[0]].point;
    if (n == 1) return (p - a).length();
    const btVector3& b = list_[chosen[1]].point;
    if (n == 2) return (p - a).cross(b - a).length() / std::max(1e-6F, (b - a).length());
    float nearest = std::numeric_limits<float>::max();
    for (int i = 0; i < n; ++i) nearest = std::min(nearest, (p - list_[chosen[i]].point).length());
    return nearest;
  }

  static constexpr int kCapacity = 96;
  FieldContact list_[kCapacity];
  int count_ = 0;
};

// Signed distance of a point (object frame) to a box or cylinder and the outward direction there.
struct SurfacePoint {
  btVector3 outward;
  float distance;
};

SurfacePoint distance_to_box(const btVector3& p, const btVector3& half) {
  const btVector3 over = p.absolute() - half;
  const btVector3 outside(std::max(0.0F, over.x()), std::max(0.0F, over.y()), std::max(0.0F, over.z()));
  const btVector3 sign(std::copysign(1.0F, p.x()), std::copysign(1.0F, p.y()), std::copysign(1.0F, p.z()));
  if (const float d = outside.length(); d > 1e-6F) return {outside * sign / d, d};
  const int axis = over.maxAxis();
  btVector3 outward(0, 0, 0);
  outward[axis] = sign[axis];
  return {outward, over[axis]};
}

SurfacePoint distance_to_cylinder(const btVector3& p, float radius, float half_height) {
  const float across = std::sqrt(p.x() * p.x() + p.y() * p.y());
  const btVector3 radial = across > 1e-9F ? btVector3(p.x() / across, p.y() / across, 0) : btVector3(1, 0, 0);
  const btVector3 axial(0, 0, std::copysign(1.0F, p.z()));
  const float over_r = across - radius, over_z = std::abs(p.z()) - half_height;
  const float out_r = std::max(0.0F, over_r), out_z = std::max(0.0F, over_z);
  if (const float d = std::sqrt(out_r * out_r + out_z * out_z); d > 1e-6F)
    return {(radial * out_r + axial * out_z) / d, d};
  return over_r > over_z ? SurfacePoint{radial, over_r} : SurfacePoint{axial, over_z};
}

// Points of the object that touch a plane first: a box's corners; on each rim of a cylinder eight points, one of
// them the lowest.
struct FeaturePoints {
  btVector3 point[16];
  int count = 0;
};

FeaturePoints feature_points(const scene::ObjectSpec& object, const btVector3& half, const btTransform& pose) {
  FeaturePoints f;
  if (object.shape == scene::ShapeKind::kBox) {
    for (int i = 0; i < 8; ++i)
      f.point[f.count++] = pose * (half * btVector3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F));
    return f;
  }
  const btVector3 down = pose.getBasis().transpose() * btVector3(0, 0, -1);
  btVector3 lowest(down.x(), down.y(), 0);
  lowest = lowest.length2() > 1e-10F ? lowest.normalized() : btVector3(1, 0, 0);
  const btVector3 side(-lowest.y(), lowest.x(), 0);
  constexpr float kDiagonal = 0.70710678F;
  const float along[8] = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
  for (int end = -1; end <= 1; end += 2)
    for (int i = 0; i < 8; ++i) {
      const btVector3 rim = (lowest * along[i] + side * along[(i + 6) % 8]) * half.x();
      f.point[f.count++] = pose * (rim + btVector3(0, 0, half.z() * static_cast<float>(end)));
    }
  return f;
}

class ConvexContacts {
 public:
  ConvexContacts(const Columns& columns, const scene::ObjectSpec& object, const btConvexShape& shape,
                 const btTransform& pose, float margin)
      : columns_(columns), object_(object), shape_(shape), pose_(pose), margin_(margin),
        half_(static_cast<float>(object.half_extents().x()), static_cast<float>(object.half_extents().y()),
              static_cast<float>(object.half_extents().z())),
        features_(feature_points(object, half_, pose)) {
    const btVector3 reach = pose.getBasis().absolute() * half_ + btVector3(margin, margin, margin);
    low_ = pose.getOrigin() - reach;
    high_ = pose.getOrigin() + reach;
  }

  FieldContactSet find() {
    const CellRange cells = columns_.covering(low_.x(), high_.x(), low_.y(), high_.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c)
        if (columns_.top(r, c) >= low_.z()) touch(columns_.at(r, c), columns_.index(r, c));
    return candidates_.pick();
  }

 private:
  void touch(const Column& q, int cell) {
    bool found = false;
    for (int i = 0; i < features_.count; ++i) found |= feature_on_column(features_.point[i], q, cell);
    // A flat object on a level patch rests on its own corners or on the patch's rim: inner cells add nothing.
    if (q.all_bridged()) return;
    found |= corner_in_object(q, cell, q.west, q.north);
    found |= corner_in_object(q, cell, q.east, q.north);
    found |= corner_in_object(q, cell, q.west, q.south);
    found |= corner_in_object(q, cell, q.east, q.south);
    if (!found) edges(q, cell);
  }

  bool feature_on_column(const btVector3& p, const Column& q, int cell) {
    if (!q.contains(p.x(), p.y()) || p.z() > q.top + margin_) return false;
    const WayOut out = way_out(q, p);
    candidates_.add({p - out.normal * out.distance, out.normal, out.distance, cell});
    return true;
  }

  // A corner of the pin's top against the object. On a bridged side the corner is a point of the patch's rim, and
  // still holds the object; only leaning over the bridge is not its business.
  bool corner_in_object(const Column& q, int cell, float x, float y) {
    const btVector3 corner(x, y, q.top);
    const btVector3 local = pose_.invXform(corner);
    const SurfacePoint s = object_.shape == scene::ShapeKind::kBox
                               ? distance_to_box(local, half_)
                               : distance_to_cylinder(local, half_.x(), half_.z());
    if (s.distance > margin_) return false;
    const btVector3 normal = -(pose_.getBasis() * s.outward);
    if (normal.z() < -0.01F || q.leans_over_bridge(normal.x(), normal.y(), kLeanTolerance)) return false;
    candidates_.add({corner, normal, s.distance, cell});
    return true;
  }

  // Edge against edge, and everything that no corner tells: the nearest points of the two convex shapes.
  void edges(const Column& q, int cell) {
    const float depth = std::max(1.0F, q.top - low_.z() + 1.0F);
    btBoxShape pin(btVector3(0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * depth));
    pin.setMargin(0.0F);
    btVoronoiSimplexSolver simplex;
    btGjkEpaPenetrationDepthSolver penetration;
    btGjkPairDetector detector(&shape_, &pin, &simplex, &penetration);
    btGjkPairDetector::ClosestPointInput input;
    input.m_transformA = pose_;
    input.m_transformB.setIdentity();
    input.m_transformB.setOrigin({0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * depth});
    input.m_maximumDistanceSquared = margin_ * margin_;
    btPointCollector nearest;
    detector.getClosestPoints(input, nearest, nullptr);
    if (!nearest.m_hasResult || nearest.m_distance > margin_) return;
    const btVector3& n = nearest.m_normalOnBInWorld;
    if (n.z() < -0.01F || q.leans_over_bridge(n.x(), n.y(), kLeanTolerance)) return;
    candidates_.add({nearest.m_pointInWorld, n, nearest.m_distance, cell});
  }

  const Columns& columns_;
  const scene::ObjectSpec& object_;
  const btConvexShape& shape_;
  const btTransform& pose_;
  const float margin_;
  const btVector3 half_;
  const FeaturePoints features_;
  btVector3 low_, high_;
  Candidates candidates_;
};

}  // namespace

FieldContactSet find_field_contacts(const surface::Field& field, const scene::ObjectSpec& object,
                                    const btConvexShape& shape, const btTransform& pose, float margin) {
  const btVector3& centre = pose.getOrigin();
  const auto width = static_cast<float>(2.0 * object.half_extents().minCoeff());
  const Columns columns(field, width);
  if (object.shape == scene::ShapeKind::kSphere) {
    const auto radius = static_cast<float>(object.radius);
    if (centre.z() - radius - margin > field.max_height) return {};
    return sphere_contacts(columns, radius, centre, margin);
  }
  const auto reach = static_cast<float>(object.half_extents().norm());
  if (centre.z() - reach - margin > field.max_height) return {};
  return ConvexContacts(columns, object, shape, pose, margin).find();
}

}  // namespace smartsurf::world
