// The bodies in the lanes of an octet, as the contact kernels work on them. Included once per instruction
// set, hence no usual guard.
#if defined(SMARTSURF_WORLD_CONTACT_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SMARTSURF_WORLD_CONTACT_LANES_INL_H
#undef SMARTSURF_WORLD_CONTACT_LANES_INL_H
#else
#define SMARTSURF_WORLD_CONTACT_LANES_INL_H
#endif

#include "smartsurf/world/ContactKernels.h"
#include "smartsurf/world/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// The bodies on one side of the lanes. No multiply and add is fused: the same bits on every machine.
struct Side {
  V3 velocity, spin;
  V inverse_mass, inverse_inertia;
};

struct At {
  Point& point;
  PointDetail& detail;
};

HWY_INLINE Side load_side(const Motion* rows, const std::int32_t* index) {
  Side s;
  load_rows(&rows->velocity[0], index, 0, s.velocity.x, s.velocity.y, s.velocity.z, s.inverse_mass);
  load_rows(&rows->velocity[0], index, 4, s.spin.x, s.spin.y, s.spin.z, s.inverse_inertia);
  return s;
}

HWY_INLINE void store_side(const Side& s, Motion* rows, const std::int32_t* index, int count) {
  float* base = &rows->velocity[0];
  store_rows(s.velocity.x, s.velocity.y, s.velocity.z, s.inverse_mass, base, index, count, 0);
  store_rows(s.spin.x, s.spin.y, s.spin.z, s.inverse_inertia, base, index, count, 4);
}

HWY_INLINE Symmetric load_inertia(const Inertia* rows, const std::int32_t* index) {
  Symmetric s;
  V unused, unused_too;
  load_rows(&rows->xx, index, 0, s.xx, s.yy, s.zz, s.xy);
  load_rows(&rows->xx, index, 4, s.xz, s.yz, unused, unused_too);
  return s;
}

// The eight pairs of one octet (or half of them, where vectors are short), at one of the four kinds.
template <bool kPair, bool kRound>
struct Lanes {
  const Octet& octet;
  const int lane;  // the first
  Motion* const motion;
  Side a, b;
  Symmetric inertia_a, inertia_b;

  HWY_INLINE Lanes(const Octet& o, int first, const BodyRows& rows)
      : octet(o), lane(first), motion(rows.motion) {
    a = load_side(rows.motion, &o.a[first]);
    if constexpr (kPair) b = load_side(rows.motion, &o.b[first]);
    if constexpr (!kRound) {
      inertia_a = load_inertia(rows.inertia, &o.a[first]);
      if constexpr (kPair) inertia_b = load_inertia(rows.inertia, &o.b[first]);
    }
  }
  HWY_INLINE void store() const {
    store_side(a, motion, &octet.a[lane], octet.count - lane);
    if constexpr (kPair) store_side(b, motion, &octet.b[lane], octet.count - lane);
  }

  HWY_INLINE V3 arm_a(const At& q) const { return load3(q.detail.arm_a, lane); }
  HWY_INLINE V3 arm_b(const At& q) const { return load3(q.detail.arm_b, lane); }

  // Of a's surface against b's, or the world's.
  HWY_INLINE V3 relative_velocity(const At& q, const V3& normal) const {
    V3 dv = a.velocity;
    if constexpr (kPair) dv = dv - b.velocity;
    if constexpr (!kPair) dv = dv - load3(q.detail.surface, lane);
    if constexpr (kRound) {
      V3 turning = a.spin * load(q.point.radius_a, lane);
      if constexpr (kPair) turning = turning + b.spin * load(q.point.radius_b, lane);
      return dv - cross(turning, normal);
    } else {
      dv = dv + cross(a.spin, arm_a(q));
      if constexpr (kPair) dv = dv - cross(b.spin, arm_b(q));
      return dv;
    }
  }

  HWY_INLINE V3 relative_spin(const At& q) const {
    V3 w = a.spin;
    if constexpr (kPair) w = w - b.spin;
    if constexpr (!kPair) w.z = w.z - load(q.detail.surface_spin, lane);
    return w;
  }

  HWY_INLINE void push(const At& q, const V3& impulse, const V3& normal, bool along_normal) {
    a.velocity = a.velocity + impulse * a.inverse_mass;
    if constexpr (kPair) b.velocity = b.velocity - impulse * b.inverse_mass;
    if constexpr (kRound) {
      if (along_normal) return;
      const V3 turn = cross(normal, impulse);
      a.spin = a.spin - turn * (a.inverse_inertia * load(q.point.radius_a, lane));
      if constexpr (kPair) b.spin = b.spin - turn * (b.inverse_inertia * load(q.point.radius_b, lane));
    } else {
      a.spin = a.spin + inertia_a * cross(arm_a(q), impulse);
      if constexpr (kPair) b.spin = b.spin - inertia_b * cross(arm_b(q), impulse);
    }
  }

  HWY_INLINE void twist(const V3& impulse) {
    if constexpr (kRound) {
      a.spin = a.spin + impulse * a.inverse_inertia;
      if constexpr (kPair) b.spin = b.spin - impulse * b.inverse_inertia;
    } else {
      a.spin = a.spin + inertia_a * impulse;
      if constexpr (kPair) b.spin = b.spin - inertia_b * impulse;
    }
  }

  // How fast the point yields to a unit impulse along u, measured along v.
  HWY_INLINE V yielding(const At& q, const V3& u, const V3& v, V straight) const {
    const V3 ra = arm_a(q);
    V k = straight + dot(cross(ra, v), inertia_a * cross(ra, u));
    if constexpr (kPair) {
      const V3 rb = arm_b(q);
      k = k + dot(cross(rb, v), inertia_b * cross(rb, u));
    }
    return k;
  }
  // Where the point goes by that, as far as the bodies turn.
  HWY_INLINE V3 yielded(const At& q, const V3& u) const {
    const V3 ra = arm_a(q);
    V3 way = cross(inertia_a * cross(ra, u), ra);
    if constexpr (kPair) {
      const V3 rb = arm_b(q);
      way = way + cross(inertia_b * cross(rb, u), rb);
    }
    return way;
  }
};

// How far the bodies have moved since the step began.
template <bool kPair, bool kRound>
struct Moved {
  V3 a, b, turn_a, turn_b;

  HWY_INLINE Moved(const Octet& o, int lane, const BodyRows& rows) {
    load_way(rows, &o.a[lane], a, turn_a);
    if constexpr (kPair) load_way(rows, &o.b[lane], b, turn_b);
  }
  HWY_INLINE static void load_way(const BodyRows& rows, const std::int32_t* index, V3& by, V3& turn) {
    V unused;
    load_rows(&rows.shift->by[0], index, 0, by.x, by.y, by.z, unused);
    if constexpr (!kRound) load_rows(&rows.shift->by[0], index, 4, turn.x, turn.y, turn.z, unused);
  }

  // The gap now.
  HWY_INLINE V gap(const Lanes<kPair, kRound>& l, const At& q, const V3& n, const Pass& pass) const {
    V3 way = a;
    if constexpr (!kRound) way = way + cross(turn_a, l.arm_a(q));
    if constexpr (kPair) way = way - b;
    if constexpr (kPair && !kRound) way = way - cross(turn_b, l.arm_b(q));
    if constexpr (!kPair) way = way - load3(q.detail.surface, l.lane) * set(pass.elapsed_s);
    return load(q.point.gap, l.lane) + dot(n, way);
  }
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#endif
