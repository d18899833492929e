// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/ContactKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/ContactKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// Overlaps up to this are left alone, so that what rests keeps its contacts, u.
constexpr float kSlop = 1e-3F;

// The bodies on one side of the lanes. No multiply and add is fused: the same bits on every machine.
struct Side {
  V3 velocity, spin;
  V inverse_mass, inverse_inertia;
};

struct At {
  Point& point;
  PointDetail& detail;
};

struct Symmetric {
  V xx, yy, zz, xy, xz, yz;
  HWY_INLINE V3 operator*(const V3& u) const {
    return {sum3(xx * u.x, xy * u.y, xz * u.z), sum3(xy * u.x, yy * u.y, yz * u.z),
            sum3(xz * u.x, yz * u.y, zz * u.z)};
  }
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
};

template <bool kPair, bool kRound>
HWY_INLINE void prepare_point(const Lanes<kPair, kRound>& l, const At& q) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  V straight = l.a.inverse_mass;
  if constexpr (kPair) straight = straight + l.b.inverse_mass;
  V along, across, turning;
  if constexpr (kRound) {
    const V ra = load(q.point.radius_a, at);
    along = straight;
    across = straight + l.a.inverse_inertia * ra * ra;
    turning = l.a.inverse_inertia;
    if constexpr (kPair) {
      const V rb = load(q.point.radius_b, at);
      across = across + l.b.inverse_inertia * rb * rb;
      turning = turning + l.b.inverse_inertia;
    }
  } else {
    along = l.yielding(q, n, n, straight);
    // The larger eigenvalue of the 2 × 2 matrix across the normal: friction then pulls straight against the
    // slip.
    V3 t, u;
    tangents(n, t, u);
    const V tt = l.yielding(q, t, t, straight), uu = l.yielding(q, u, u, straight),
            tu = l.yielding(q, t, u, zero());
    const V half = (tt - uu) * set(0.5F);
    across = (tt + uu) * set(0.5F) + hn::Sqrt(half * half + tu * tu);
    turning = sum3(l.inertia_a.xx, l.inertia_a.yy, l.inertia_a.zz);
    if constexpr (kPair) turning = turning + sum3(l.inertia_b.xx, l.inertia_b.yy, l.inertia_b.zz);
  }
  store(inverse(along), q.point.normal_mass, at);
  store(inverse(across), q.point.tangent_mass, at);
  if (l.octet.rolls) store(inverse(turning), q.detail.rolling_mass, at);
  store(dot(n, l.relative_velocity(q, n)), q.point.approach, at);
}

template <bool kPair, bool kRound>
HWY_INLINE void warm_point(Lanes<kPair, kRound>& l, const At& q) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  l.push(q, n * load(q.point.push, at), n, true);
  l.push(q, load3(q.point.drag, at), n, false);
  if (l.octet.rolls) l.twist(load3(q.detail.roll, at));
}

// A vector no longer than the limit.
HWY_INLINE V3 limited(const V3& u, V limit) {
  const V length = hn::Max(hn::Sqrt(dot(u, u)), set(1e-30F));
  return u * hn::Min(set(1.0F), limit / length);
}

template <bool kPair, bool kRound>
HWY_INLINE void rub_and_roll(Lanes<kPair, kRound>& l, const At& q, const V3& n, const V3& velocity, V speed,
                             V pressing) {
  const int at = l.lane;
  const V3 slip = velocity - n * speed;
  const V3 old_drag = load3(q.point.drag, at);
  const V3 drag =
      limited(old_drag - slip * load(q.point.tangent_mass, at), load(q.point.friction, at) * pressing);
  store3(drag, q.point.drag, at);
  l.push(q, drag - old_drag, n, false);
  if (!l.octet.rolls) return;
  const V3 old_roll = load3(q.detail.roll, at);
  const V3 roll = limited(old_roll - l.relative_spin(q) * load(q.detail.rolling_mass, at),
                          load(q.detail.rolling, at) * pressing);
  store3(roll, q.detail.roll, at);
  l.twist(roll - old_roll);
}

// The gap now: the bodies have moved since it was measured.
template <bool kPair, bool kRound>
HWY_INLINE V gap_now(const Lanes<kPair, kRound>& l, const At& q, const V3& n, const BodyRows& rows,
                     const Pass& pass) {
  const int at = l.lane;
  const Octet& o = l.octet;
  V3 moved, turned;
  V unused;
  load_rows(&rows.shift->by[0], &o.a[at], 0, moved.x, moved.y, moved.z, unused);
  if constexpr (!kRound) {
    load_rows(&rows.shift->by[0], &o.a[at], 4, turned.x, turned.y, turned.z, unused);
    moved = moved + cross(turned, l.arm_a(q));
  }
  if constexpr (kPair) {
    V3 other;
    load_rows(&rows.shift->by[0], &o.b[at], 0, other.x, other.y, other.z, unused);
    moved = moved - other;
    if constexpr (!kRound) {
      load_rows(&rows.shift->by[0], &o.b[at], 4, turned.x, turned.y, turned.z, unused);
      moved = moved - cross(turned, l.arm_b(q));
    }
  } else {
    moved = moved - load3(q.detail.surface, at) * set(pass.elapsed_s);
  }
  return load(q.point.gap, at) + dot(n, moved);
}

// The load first, then what it lets friction hold. Between spheres neither changes the other's speed.
template <bool kSoft, bool kPair, bool kRound>
HWY_INLINE void solve_point(Lanes<kPair, kRound>& l, const At& q, const BodyRows& rows, const Pass& pass) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  V3 dv = l.relative_velocity(q, n);
  V speed = dot(n, dv);
  const V old_push = load(q.point.push, at);
  V push;
  if constexpr (kSoft) {
    const V gap = gap_now(l, q, n, rows, pass);
    const auto apart = hn::Gt(gap, zero());
    // Apart: it may close the gap within the substep and no faster. Inside: it is pushed out, softly.
    const V closing = gap * set(pass.inverse_h);
    const V pushing = hn::Max(hn::Min(gap + set(kSlop), zero()) * set(pass.rate), set(-pass.fastest_push));
    const V bias = hn::IfThenElse(apart, closing, pushing);
    const V mass = load(q.point.normal_mass, at) * hn::IfThenElse(apart, set(1.0F), set(pass.mass_scale));
    const V yielding = hn::IfThenElseZero(hn::Not(apart), set(pass.impulse_scale));
    push = hn::Max(old_push - mass * (speed + bias) - yielding * old_push, zero());
    if (!kPair && l.octet.limited) push = hn::Min(push, load(q.detail.limit, at) * set(pass.share));
    store(hn::IfThenElseZero(apart, zero() - closing), q.point.slowest, at);
  } else {
    push = hn::Max(old_push - load(q.point.normal_mass, at) * (speed - load(q.point.slowest, at)), zero());
    if (!kPair && l.octet.limited) push = hn::Min(push, load(q.detail.limit, at) * set(pass.share));
    store(load(q.point.total, at) + push, q.point.total, at);
  }
  store(push, q.point.push, at);
  l.push(q, n * (push - old_push), n, true);
  if constexpr (!kRound) {
    dv = l.relative_velocity(q, n);
    speed = dot(n, dv);
  }
  rub_and_roll(l, q, n, dv, speed, push);
}

// Towards Newton's rule at this point, whose rebound so far is where `slowest` was. Gives what it is now.
template <bool kPair, bool kRound>
HWY_INLINE V rebound_point(Lanes<kPair, kRound>& l, const At& q, const Pass& pass) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  const V speed = dot(n, l.relative_velocity(q, n));
  const V approach = load(q.point.approach, at);
  const auto hit =
      hn::And(hn::Lt(approach, set(-pass.bounce_threshold)), hn::Gt(load(q.point.total, at), zero()));
  const V wanted = zero() - load(q.detail.restitution, at) * approach;
  const V old = load(q.point.slowest, at);
  const V push = hn::Max(old + (wanted - speed) * load(q.point.normal_mass, at), zero());
  V impulse = hn::IfThenElseZero(hit, push);
  if (!kPair && l.octet.limited) {
    const V most = load(q.detail.limit, at) - (load(q.point.total, at) - old);
    impulse = hn::Min(impulse, hn::Max(most, zero()));
  }
  store(impulse, q.point.slowest, at);
  store(load(q.point.total, at) + (impulse - old), q.point.total, at);
  l.push(q, n * (impulse - old), n, true);
  return impulse;
}

// What a face gains at one corner turns it about the others: several turns, until all of them leave as they
// should.
template <bool kPair, bool kRound>
HWY_INLINE void rebound_manifold(Lanes<kPair, kRound>& l, Points points, const Pass& pass) {
  constexpr int kTurns = 8;
  const int first = l.octet.first, end = first + l.octet.points;
  for (int k = first; k < end; ++k) store(zero(), points.point[k].slowest, l.lane);
  const int turns = kRound || l.octet.points == 1 ? 1 : kTurns;
  for (int turn = 0; turn < turns; ++turn) {
    V most = zero();
    for (int k = first; k < end; ++k)
      most = hn::Max(most, rebound_point(l, At{points.point[k], points.detail[k]}, pass));
    if (turn == 0 && hn::AllFalse(D(), hn::Gt(most, zero()))) return;  // nothing hit
  }
}

template <bool kPair, bool kRound, class PointWork>
HWY_INLINE void for_each(const Octet* octets, int count, Points points, const BodyRows& rows, bool writes,
                         PointWork work) {
  for (int i = 0; i < count; ++i)
    for (int lane = 0; lane < octets[i].count; lane += kWidth) {
      Lanes<kPair, kRound> l(octets[i], lane, rows);
      for (int k = octets[i].first; k < octets[i].first + octets[i].points; ++k)
        work(l, At{points.point[k], points.detail[k]});
      if (writes) l.store();
    }
}

template <bool kPair, bool kRound>
struct Kernels {
  using L = Lanes<kPair, kRound>;
  static void prepare(const Octet* o, int n, Points p, const BodyRows& rows, const Pass&) {
    for_each<kPair, kRound>(o, n, p, rows, false, [](L& l, const At& q) HWY_ATTR { prepare_point(l, q); });
  }
  static void warm(const Octet* o, int n, Points p, const BodyRows& rows, const Pass&) {
    for_each<kPair, kRound>(o, n, p, rows, true, [](L& l, const At& q) HWY_ATTR { warm_point(l, q); });
  }
  static void solve(const Octet* o, int n, Points p, const BodyRows& rows, const Pass& pass) {
    for_each<kPair, kRound>(o, n, p, rows, true,
                            [&](L& l, const At& q) HWY_ATTR { solve_point<true>(l, q, rows, pass); });
  }
  static void relax(const Octet* o, int n, Points p, const BodyRows& rows, const Pass& pass) {
    for_each<kPair, kRound>(o, n, p, rows, true,
                            [&](L& l, const At& q) HWY_ATTR { solve_point<false>(l, q, rows, pass); });
  }
  static void rebound(const Octet* o, int n, Points p, const BodyRows& rows, const Pass& pass) {
    for (int i = 0; i < n; ++i)
      for (int lane = 0; lane < o[i].count; lane += kWidth) {
        L l(o[i], lane, rows);
        rebound_manifold(l, p, pass);
        l.store();
      }
  }
  static void enter(KernelTable& t, ContactKind kind) {
    t.prepare[kind] = prepare;
    t.warm[kind] = warm;
    t.solve[kind] = solve;
    t.relax[kind] = relax;
    t.rebound[kind] = rebound;
  }
};

const KernelTable* table() {
  static const KernelTable kTable = [] {
    KernelTable t{};
    Kernels<true, true>::enter(t, kRoundPair);
    Kernels<true, false>::enter(t, kAnyPair);
    Kernels<false, true>::enter(t, kRoundWorld);
    Kernels<false, false>::enter(t, kAnyWorld);
    return t;
  }();
  return &kTable;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(table);

const KernelTable& contact_kernels() { return *HWY_DYNAMIC_DISPATCH(table)(); }

}  // namespace smartsurf::world
#endif
