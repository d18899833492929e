// The bodies in the lanes of a contact batch, loaded into SIMD vectors for the contact kernels.
//
// Included once per instruction set, hence the toggled include guard. No multiply-add may be fused: results
// must be bit-identical on all instruction sets.
#if defined(SMARTSURF_WORLD_CONTACT_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SMARTSURF_WORLD_CONTACT_LANES_INL_H
#undef SMARTSURF_WORLD_CONTACT_LANES_INL_H
#else
#define SMARTSURF_WORLD_CONTACT_LANES_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include "smartsurf/world/solver/ContactLaw-inl.h"

// True if a vector of floats consists of two 128-bit blocks.
#undef SMARTSURF_WIDE
#define SMARTSURF_WIDE (HWY_TARGET <= HWY_AVX2)

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

using Tag = LanesTag<float>;

// Gather and scatter of rows of eight floats, one row per body. load_rows() and store_rows() transfer the
// four floats from `column` on of the bodies in the lanes.
constexpr int kRow = 8;

#if HWY_TARGET == HWY_SCALAR

HWY_INLINE void load_rows(const float* rows, const std::int32_t* index, int column, V& a, V& b, V& c, V& d) {
  const float* row = rows + std::ptrdiff_t{index[0]} * kRow + column;
  a = load(row, 0), b = load(row, 1), c = load(row, 2), d = load(row, 3);
}
HWY_INLINE void store_rows(V a, V b, V c, V d, float* rows, const std::int32_t* index, int, int column) {
  float* row = rows + std::ptrdiff_t{index[0]} * kRow + column;
  store(a, row, 0), store(b, row, 1), store(c, row, 2), store(d, row, 3);
}

#else

// Transposes a 4 × 4 matrix in each 128-bit block.
HWY_INLINE void transpose(V& a, V& b, V& c, V& d) {
  const Tag t;
  const V ac = hn::InterleaveLower(t, a, c), bd = hn::InterleaveLower(t, b, d);
  const V ac_high = hn::InterleaveUpper(t, a, c), bd_high = hn::InterleaveUpper(t, b, d);
  a = hn::InterleaveLower(t, ac, bd);
  b = hn::InterleaveUpper(t, ac, bd);
  c = hn::InterleaveLower(t, ac_high, bd_high);
  d = hn::InterleaveUpper(t, ac_high, bd_high);
}

HWY_INLINE V load_row(const float* rows, const std::int32_t* index, int lane) {
  const float* low = rows + std::ptrdiff_t{index[lane]} * kRow;
#if SMARTSURF_WIDE
  const hn::Half<Tag> half;
  const float* high = rows + std::ptrdiff_t{index[lane + 4]} * kRow;
  return hn::Combine(Tag(), hn::Load(half, high), hn::Load(half, low));
#else
  return hn::Load(Tag(), low);
#endif
}
HWY_INLINE void load_rows(const float* rows, const std::int32_t* index, int column, V& a, V& b, V& c, V& d) {
  rows += column;
  a = load_row(rows, index, 0);
  b = load_row(rows, index, 1);
  c = load_row(rows, index, 2);
  d = load_row(rows, index, 3);
  transpose(a, b, c, d);
}

// Stores nothing for lanes from `count` on.
HWY_INLINE void store_row(V value, float* rows, const std::int32_t* index, int count, int lane) {
  float* low = rows + std::ptrdiff_t{index[lane]} * kRow;
#if SMARTSURF_WIDE
  const hn::Half<Tag> half;
  if (lane < count) hn::Store(hn::LowerHalf(half, value), half, low);
  if (lane + 4 < count)
    hn::Store(hn::UpperHalf(half, value), half, rows + std::ptrdiff_t{index[lane + 4]} * kRow);
#else
  if (lane < count) hn::Store(value, Tag(), low);
#endif
}
HWY_INLINE void store_rows(V a, V b, V c, V d, float* rows, const std::int32_t* index, int count,
                           int column) {
  transpose(a, b, c, d);
  rows += column;
  store_row(a, rows, index, count, 0);
  store_row(b, rows, index, count, 1);
  store_row(c, rows, index, count, 2);
  store_row(d, rows, index, count, 3);
}

#endif

// Bodies a, or bodies b, of the lanes.
struct BodyLanes {
  V3 velocity, angular_velocity;
  V inverse_mass, inverse_inertia;
};

struct PointRef {
  BatchPoint& point;
  BatchPointDetail& detail;
  BatchPointLimit* limit;
};

HWY_INLINE PointRef point_ref(const BatchPoints& points, int k) {
  return {points.point[k], points.detail[k], points.limit + k};
}

HWY_INLINE BodyLanes load_body_lanes(const BodyVelocity* rows, const std::int32_t* index) {
  BodyLanes s;
  load_rows(&rows->velocity[0], index, 0, s.velocity.x, s.velocity.y, s.velocity.z, s.inverse_mass);
  load_rows(&rows->velocity[0], index, 4, s.angular_velocity.x, s.angular_velocity.y, s.angular_velocity.z,
            s.inverse_inertia);
  return s;
}

HWY_INLINE void store_body_lanes(const BodyLanes& s, BodyVelocity* rows, const std::int32_t* index,
                                 int count) {
  float* base = &rows->velocity[0];
  store_rows(s.velocity.x, s.velocity.y, s.velocity.z, s.inverse_mass, base, index, count, 0);
  store_rows(s.angular_velocity.x, s.angular_velocity.y, s.angular_velocity.z, s.inverse_inertia, base, index,
             count, 4);
}

HWY_INLINE SymmetricMat3<V> load_inertia(const InverseInertia* rows, const std::int32_t* index) {
  SymmetricMat3<V> s;
  V unused, unused_too;
  load_rows(&rows->xx, index, 0, s.xx, s.yy, s.zz, s.xy);
  load_rows(&rows->xx, index, 4, s.xz, s.yz, unused, unused_too);
  return s;
}

// Up to kVectorWidth manifolds of a batch, specialised for one ContactKind.
template <bool kPair, bool kSpheres>
struct ContactLanes {
  static constexpr ContactKind kKind =
      kPair ? (kSpheres ? kSpherePair : kGeneralPair) : (kSpheres ? kSphereStatic : kGeneralStatic);
  const ContactBatch& batch;
  const int lane;  // first lane in the batch
  BodyVelocity* const velocities;
  BodyLanes a, b;
  SymmetricMat3<V> inertia_a, inertia_b;

  HWY_INLINE ContactLanes(const ContactBatch& o, int first, const SolverBodies& rows)
      : batch(o), lane(first), velocities(rows.velocity) {
    a = load_body_lanes(rows.velocity, &o.a[first]);
    if constexpr (kPair) b = load_body_lanes(rows.velocity, &o.b[first]);
    if constexpr (!kSpheres) {
      inertia_a = load_inertia(rows.inverse_inertia, &o.a[first]);
      if constexpr (kPair) inertia_b = load_inertia(rows.inverse_inertia, &o.b[first]);
    }
  }
  HWY_INLINE void store() const {
    store_body_lanes(a, velocities, &batch.a[lane], batch.lane_count - lane);
    if constexpr (kPair) store_body_lanes(b, velocities, &batch.b[lane], batch.lane_count - lane);
  }

  HWY_INLINE V3 anchor_a(const PointRef& q) const { return load3(q.detail.anchor_a, lane); }
  HWY_INLINE V3 anchor_b(const PointRef& q) const { return load3(q.detail.anchor_b, lane); }

  // Velocity of a's surface relative to b's, or to the static surface.
  HWY_INLINE V3 relative_velocity(const PointRef& q, const V3& normal) const {
    V3 dv = a.velocity;
    if constexpr (kPair) dv = dv - b.velocity;
    if constexpr (!kPair || !kSpheres) dv = dv - load3(q.detail.surface_velocity, lane);
    if constexpr (kSpheres) {
      V3 surface_rotation = a.angular_velocity * load(q.point.radius_a, lane);
      if constexpr (kPair)
        surface_rotation = surface_rotation + b.angular_velocity * load(q.point.radius_b, lane);
      return dv - cross(surface_rotation, normal);
    } else {
      dv = dv + cross(a.angular_velocity, anchor_a(q));
      if constexpr (kPair) dv = dv - cross(b.angular_velocity, anchor_b(q));
      return dv;
    }
  }

  HWY_INLINE V3 relative_angular_velocity(const PointRef& q) const {
    V3 w = a.angular_velocity;
    if constexpr (kPair) w = w - b.angular_velocity;
    if constexpr (!kPair) w.z = w.z - load(q.detail.surface_spin, lane);
    return w;
  }

  // `along_normal`: the impulse is parallel to the normal and exerts no torque on a sphere.
  HWY_INLINE void apply_impulse(const PointRef& q, const V3& impulse, const V3& normal, bool along_normal) {
    a.velocity = a.velocity + impulse * a.inverse_mass;
    if constexpr (kPair) b.velocity = b.velocity - impulse * b.inverse_mass;
    if constexpr (kSpheres) {
      if (along_normal) return;
      const V3 angular_impulse = cross(normal, impulse);
      a.angular_velocity =
          a.angular_velocity - angular_impulse * (a.inverse_inertia * load(q.point.radius_a, lane));
      if constexpr (kPair)
        b.angular_velocity =
            b.angular_velocity - angular_impulse * (b.inverse_inertia * load(q.point.radius_b, lane));
    } else {
      a.angular_velocity = a.angular_velocity + inertia_a * cross(anchor_a(q), impulse);
      if constexpr (kPair) b.angular_velocity = b.angular_velocity - inertia_b * cross(anchor_b(q), impulse);
    }
  }

  HWY_INLINE void apply_angular_impulse(const V3& impulse) {
    if constexpr (kSpheres) {
      a.angular_velocity = a.angular_velocity + impulse * a.inverse_inertia;
      if constexpr (kPair) b.angular_velocity = b.angular_velocity - impulse * b.inverse_inertia;
    } else {
      a.angular_velocity = a.angular_velocity + inertia_a * impulse;
      if constexpr (kPair) b.angular_velocity = b.angular_velocity - inertia_b * impulse;
    }
  }

  // Relative velocity along v that a unit impulse along u causes at the point.
  HWY_INLINE V inverse_effective_mass(const PointRef& q, const V3& u, const V3& v, V inverse_mass_sum) const {
    const V3 ra = anchor_a(q);
    V k = inverse_mass_sum + dot(cross(ra, v), inertia_a * cross(ra, u));
    if constexpr (kPair) {
      const V3 rb = anchor_b(q);
      k = k + dot(cross(rb, v), inertia_b * cross(rb, u));
    }
    return k;
  }
  // Rotational part of the relative velocity that a unit impulse along u causes at the point.
  HWY_INLINE V3 angular_response(const PointRef& q, const V3& u) const {
    const V3 ra = anchor_a(q);
    V3 response = cross(inertia_a * cross(ra, u), ra);
    if constexpr (kPair) {
      const V3 rb = anchor_b(q);
      response = response + cross(inertia_b * cross(rb, u), rb);
    }
    return response;
  }
};

// Delta poses of the bodies in the lanes.
template <bool kPair, bool kSpheres>
struct DeltaPoseLanes {
  V3 translation_a, translation_b, rotation_a, rotation_b;

  HWY_INLINE DeltaPoseLanes(const ContactBatch& o, int lane, const SolverBodies& rows) {
    load_delta_pose(rows, &o.a[lane], translation_a, rotation_a);
    if constexpr (kPair) load_delta_pose(rows, &o.b[lane], translation_b, rotation_b);
  }
  HWY_INLINE static void load_delta_pose(const SolverBodies& rows, const std::int32_t* index, V3& translation,
                                         V3& rotation) {
    V unused;
    load_rows(&rows.delta_pose->translation[0], index, 0, translation.x, translation.y, translation.z,
              unused);
    if constexpr (!kSpheres)
      load_rows(&rows.delta_pose->translation[0], index, 4, rotation.x, rotation.y, rotation.z, unused);
  }

  // The points of a pair lie on the smaller body, which moves over the larger one that carries it. The
  // result is what b's surface gains on a's because the points have moved since they were at the anchors, in
  // the middle of the substep (the midpoint rule).
  HWY_INLINE V3 carrying_velocity(const ContactLanes<kPair, kSpheres>& l, const PointRef& q,
                                  const SubstepParams& params) const {
    static_assert(kPair && !kSpheres);
    const V larger_a = load(q.point.radius_a, l.lane) - load(q.point.radius_b, l.lane);
    const V3 &of_a = l.a.angular_velocity, &of_b = l.b.angular_velocity;
    const V3 carrier{if_positive(larger_a, of_a.x, of_b.x), if_positive(larger_a, of_a.y, of_b.y),
                     if_positive(larger_a, of_a.z, of_b.z)};
    const V ahead = set(0.5F * params.h_s) - load(q.detail.anchor_time, l.lane);
    return cross(carrier, translation_a - translation_b + (l.a.velocity - l.b.velocity) * ahead);
  }

  // Current separation along the normal n, to first order.
  HWY_INLINE V separation(const ContactLanes<kPair, kSpheres>& l, const PointRef& q, const V3& n,
                          const SubstepParams& params) const {
    V3 displacement = translation_a;
    if constexpr (!kSpheres) displacement = displacement + cross(rotation_a, l.anchor_a(q));
    if constexpr (kPair) displacement = displacement - translation_b;
    if constexpr (kPair && !kSpheres) displacement = displacement - cross(rotation_b, l.anchor_b(q));
    if constexpr (!kPair)
      displacement = displacement - load3(q.detail.surface_velocity, l.lane) * set(params.elapsed_s);
    return load(q.point.separation, l.lane) + dot(n, displacement);
  }
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#endif
