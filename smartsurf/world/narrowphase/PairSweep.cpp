#include "smartsurf/world/narrowphase/PairSweep.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/narrowphase/Gjk.h"
#include "smartsurf/world/narrowphase/InternalEdges.h"
#include "smartsurf/world/narrowphase/PairContacts.h"

namespace smartsurf::world {
namespace {

constexpr int kMaxAdvances = 48;
constexpr float kMet = 2e-3F;  // parts up to this far apart have met, u
// Parts that touch at the start have met if they close by more than this in the step, u.
constexpr float kApproach = 0.01F;

constexpr float kAllowedOverlap = 0.1F;  // of the width of a shape
constexpr float kKnownShare = 0.9F;      // of the depth from which on the cores overlap

}  // namespace

PairSweep::Motion::Motion(const BodyStore& bodies, std::size_t i)
    : shape(*bodies.shape[i]),
      position(bodies.position[i]),
      velocity(Vec3::Zero()),
      angular_velocity(Vec3::Zero()),
      local_origin(bodies.local_origin[i]),
      axes(bodies.is_sphere[i] ? Mat3(Mat3::Identity()) : bodies.axes[i]),
      origin_offset(bodies.origin(i) - bodies.position[i]),
      is_sphere(bodies.is_sphere[i] != 0) {
  turning_speed = 0.0F;
  if (!bodies.is_active(i)) return;
  velocity = bodies.velocity(i);
  if (!is_sphere) angular_velocity = bodies.angular_velocity(i);
  turning_speed = angular_velocity.norm() * bodies.bounding_radius[i];
}

PairSweep::Placed PairSweep::Motion::at(float time_s) const {
  if (turning_speed == 0.0F) return {shape, position + time_s * velocity + origin_offset, axes};
  const Mat3 turned = rotation_from_vector(time_s * angular_velocity).toRotationMatrix() * axes;
  // The offset turns with the body. For an axisymmetric shape it lies on the axis.
  const Vec3 offset = turned * (axes.transpose() * origin_offset);
  return {shape, position + time_s * velocity + offset, turned};
}

PairSweep::Motion::Motion(const BodyStore& bodies, std::size_t i, float dt_s, const DeltaPose& motion)
    : Motion(bodies, i) {
  velocity = Vec3(motion.translation) / dt_s;
  if (!is_sphere) angular_velocity = Vec3(motion.rotation) / dt_s;
  turning_speed = angular_velocity.norm() * bodies.bounding_radius[i];
}

PairSweep::PairSweep(Motion a, Motion b, float dt_s, bool anchors_follow_b)
    : a_(std::move(a)),
      b_(std::move(b)),
      dt_s_(dt_s),
      turning_speed_(a_.turning_speed + b_.turning_speed),
      travel_(dt_s * ((a_.velocity - b_.velocity).norm() + turning_speed_)),
      anchors_follow_b_(anchors_follow_b) {}

PairSweep::PairSweep(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s)
    : PairSweep(Motion(bodies, a), Motion(bodies, b), dt_s,
                !bodies.is_static(b) && bodies.mass[a] > bodies.mass[b]) {}

PairSweep::PairSweep(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s,
                     const DeltaPose& motion_a, const DeltaPose& motion_b)
    : PairSweep(Motion(bodies, a, dt_s, motion_a), Motion(bodies, b, dt_s, motion_b), dt_s, false) {}

// Distances beyond `reach` are lower bounds.
PairSweep::Gap PairSweep::gap(const ConvexPart& part_a, const ConvexPart& part_b, const Placed& a,
                              const Placed& b, float reach) const {
  if (a_.is_sphere || b_.is_sphere) {
    const Placed &sphere = a_.is_sphere ? a : b, &other = a_.is_sphere ? b : a;
    const float radius = sphere.shape.bounding_radius;
    const SignedDistance d =
        signed_distance(a_.is_sphere ? part_b : part_a,
                        other.axes.transpose() * (sphere.centre - other.centre), radius + reach);
    const Vec3 normal = other.axes * d.normal;
    return {a_.is_sphere ? normal : Vec3(-normal), d.distance - radius};
  }
  const PlacedShape placed_a{a.shape, a.centre, a.axes}, placed_b{b.shape, b.centre, b.axes};
  const bool trim_a = is_much_larger(placed_a, placed_b),
             trim_b = !trim_a && is_much_larger(placed_b, placed_a);
  if (trim_a || trim_b) {
    const PlacedShape &box = trim_a ? placed_a : placed_b, &other = trim_a ? placed_b : placed_a;
    // GJK is most exact on a small part of a large box: which has the closest point if that is near.
    const auto trimmed_gap = [&](float within) -> Gap {
      const TrimmedBox t = trim(box, other.centre, 2.0F * other.shape.bounding_radius + within);
      if (!t.overlaps) return {Vec3::Zero(), 2.0F * within};
      const ConvexPart part{t.shape, nullptr};
      return trim_a ? gap(ConvexProxy(part, t.centre, a.axes), ConvexProxy(part_b, b.centre, b.axes), within)
                    : gap(ConvexProxy(part_a, a.centre, a.axes), ConvexProxy(part, t.centre, b.axes), within);
    };
    const float near = other.shape.bounding_radius;
    const Gap g = trimmed_gap(std::min(near, reach));
    return g.distance <= near || reach <= near ? g : trimmed_gap(reach);
  }
  return gap(ConvexProxy(part_a, a.centre, a.axes), ConvexProxy(part_b, b.centre, b.axes), reach);
}

PairSweep::Gap PairSweep::gap(const ConvexProxy& proxy_a, const ConvexProxy& proxy_b, float reach) {
  const float radii = proxy_a.convex_radius + proxy_b.convex_radius;
  const ClosestPoints closest =
      closest_points(proxy_a, proxy_b, radii + reach, Vec3(proxy_a.centre - proxy_b.centre));
  return {closest.normal, closest.separated ? closest.distance - radii : -radii};
}

template <class AtStart>
float PairSweep::advance(const ConvexPart& part_a, const ConvexPart& part_b, float until_s, Range range,
                         AtStart at_start) const {
  const Vec3 velocity = a_.velocity - b_.velocity;
  const float middle = 0.5F * (range.low + range.high);
  float time_s = 0.0F;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const float left_s = until_s - time_s;
    const Gap g = gap(part_a, part_b, a_.at(time_s), b_.at(time_s),
                      left_s * (velocity.norm() + turning_speed_) + std::abs(range.high));
    const float approach = std::max(0.0F, -g.normal.dot(velocity));
    if (g.distance <= range.high) return i > 0 || at_start(approach * left_s) ? time_s : kNever;
    // The distance along a fixed direction shrinks at this speed at most.
    const float speed = approach + turning_speed_;
    if (speed * left_s < g.distance - range.high) return kNever;
    time_s += (g.distance - middle) / speed;
    if (time_s > until_s) return kNever;
  }
  return time_s;
}

float PairSweep::time_of_impact() const {
  float first = kNever;
  for_each_part(a_.shape, [&](const ConvexPart& part_a) {
    for_each_part(b_.shape, [&](const ConvexPart& part_b) {
      first = std::min(first, advance(part_a, part_b, std::min(first, dt_s_), {0.0F, kMet},
                                      [](float approach) { return approach > kApproach; }));
    });
  });
  return first;
}

PairSweep::Overlap PairSweep::find_overlap() const {
  // Depths up to which parts may overlap, and up to which the gap between them is known, and known to be on
  // the right side.
  const auto allowed_depth = [](const ConvexPart& part) {
    if (part.shape.is_sphere()) return 0.5F * part.shape.bounding_radius;
    if (part.hull != nullptr) return part.hull->convex_radius;
    return std::min(part.shape.convex_radius, kAllowedOverlap * part.shape.width);
  };
  const auto known_depth = [](const ConvexPart& part) {
    if (part.shape.is_sphere()) return kKnownShare * part.shape.bounding_radius;
    return kKnownShare * (part.hull != nullptr ? part.hull->convex_radius : part.shape.convex_radius);
  };
  const Placed a = a_.at(0.0F), b = b_.at(0.0F);
  Overlap found;
  float& first = found.time_s;
  for_each_part(a_.shape, [&](const ConvexPart& part_a) {
    for_each_part(b_.shape, [&](const ConvexPart& part_b) {
      const float allowed = allowed_depth(part_a) + allowed_depth(part_b);
      // Parts that overlap already are let in deeper by a share of what is left, or the last bit of what is
      // known.
      const float distance = gap(part_a, part_b, a, b, travel_).distance;
      const float start = std::min(0.0F, distance + 0.25F * allowed);
      const float known = known_depth(part_a) + known_depth(part_b);
      // How much deeper they may get until their side is unknown.
      const float end = known / kKnownShare + distance;
      if (end < 1e-3F * allowed) {
        found.are_pierced = true;
        return;
      }
      const float left = std::max(allowed + start, std::min(0.1F * allowed, known + start));
      Range range{start - 0.5F * left, start - 0.3F * left};
      // A range above the present distance would stop deep ones at once, also those that move apart or turn.
      range.low = std::min(range.low, distance - 0.2F * left);
      range.high = std::min(range.high, distance - 0.1F * left);
      if (left < 0.1F * allowed) {
        // Beyond what is known, by half of what is left until their side is unknown.
        range = {distance - 0.75F * end, distance - 0.5F * end};
      }
      first =
          std::min(first, advance(part_a, part_b, std::min(first, dt_s_), range, [](float) { return true; }));
    });
  });
  return found;
}

void PairSweep::collide_at(float time_s, float margin, std::vector<Contact>& out) const {
  const Placed a = a_.at(time_s), b = b_.at(time_s);
  collide_placed({a.shape, a.centre, a.axes}, {b.shape, b.centre, b.axes}, margin, out);
}

void PairSweep::correct_internal_edges(float time_s, std::vector<Contact>& contacts,
                                       std::size_t first) const {
  const Placed a = a_.at(time_s), b = b_.at(time_s);
  world::correct_internal_edges({a.shape, a.centre, a.axes}, {b.shape, b.centre, b.axes}, contacts, first);
}

void PairSweep::move_to_start(float time_s, std::span<Contact> contacts) const {
  if (time_s <= 0.0F) return;
  const Vec3 offset_a = a_.at(time_s).centre - a_.position - time_s * a_.velocity;
  const Vec3 motion = time_s * (a_.velocity - b_.velocity);
  for (Contact& c : contacts) {
    const Vec3 anchor_a =
        a_.is_sphere ? Vec3(-a_.shape.bounding_radius * c.normal) : Vec3(c.anchor + offset_a);
    const Vec3 anchor_b = a_.position - b_.position + motion + anchor_a;
    c.separation -= c.normal.dot(a_.displacement(time_s, anchor_a) - b_.displacement(time_s, anchor_b));
    // A contact has one point; its lever is right for the lighter body.
    c.anchor = anchor_a - a_.origin_offset;
    if (anchors_follow_b_) c.anchor += motion;
  }
}

}  // namespace smartsurf::world
