// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/ContactKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/ContactKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/ContactLanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// Overlaps up to this are left alone, so that what rests keeps its contacts, u.
constexpr float kSlop = 1e-3F;

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
    const V3 yielded = l.yielded(q, n);
    store3(yielded - n * dot(n, yielded), q.detail.slip, at);
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
HWY_INLINE void roll(Lanes<kPair, kRound>& l, const At& q, V pressing) {
  const int at = l.lane;
  const V3 old_roll = load3(q.detail.roll, at);
  const V3 roll = limited(old_roll - l.relative_spin(q) * load(q.detail.rolling_mass, at),
                          load(q.detail.rolling, at) * pressing);
  store3(roll, q.detail.roll, at);
  l.twist(roll - old_roll);
}

// Towards no overlap at the end of the substep. Returns the push.
template <bool kPair, bool kRound>
HWY_INLINE V part(const Lanes<kPair, kRound>& l, const At& q, V speed, V gap, const Pass& pass) {
  const int at = l.lane;
  const auto apart = hn::Gt(gap, zero());
  // Apart: it may close the gap within the substep and no faster. Inside: it is pushed out, softly.
  const V closing = gap * set(pass.inverse_h);
  const V pushing = hn::Max(hn::Min(gap + set(kSlop), zero()) * set(pass.rate), set(-pass.fastest_push));
  const V bias = hn::IfThenElse(apart, closing, pushing);
  const V mass = load(q.point.normal_mass, at) * hn::IfThenElse(apart, set(1.0F), set(pass.mass_scale));
  const V yielding = hn::IfThenElseZero(hn::Not(apart), set(pass.impulse_scale));
  store(hn::IfThenElseZero(apart, zero() - closing), q.point.slowest, at);
  const V old_push = load(q.point.push, at);
  return hn::Max(old_push - mass * (speed + bias) - yielding * old_push, zero());
}

// Takes out the speed that is left. Returns the push.
template <bool kPair, bool kRound>
HWY_INLINE V relaxed(const Lanes<kPair, kRound>& l, const At& q, V speed) {
  const int at = l.lane;
  return hn::Max(load(q.point.push, at) - load(q.point.normal_mass, at) * (speed - load(q.point.slowest, at)),
                 zero());
}

// The load first, then what it lets friction hold. Between spheres neither changes the other's speed.
template <bool kPair, bool kRound, class FindPush>
HWY_INLINE V solve_point(Lanes<kPair, kRound>& l, const At& q, const Pass& pass, FindPush find_push) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  const V3 velocity = l.relative_velocity(q, n);
  const V speed = dot(n, velocity);
  V push = find_push(n, speed);
  if (!kPair && l.octet.limited) push = hn::Min(push, load(q.detail.limit, at) * set(pass.share));
  const V change = push - load(q.point.push, at);
  store(push, q.point.push, at);
  V3 slip = velocity - n * speed;
  if constexpr (!kRound) slip = slip + load3(q.detail.slip, at) * change;
  const V3 old_drag = load3(q.point.drag, at);
  const V3 drag =
      limited(old_drag - slip * load(q.point.tangent_mass, at), load(q.point.friction, at) * push);
  store3(drag, q.point.drag, at);
  if constexpr (kRound) {
    l.push(q, n * change, n, true);
    l.push(q, drag - old_drag, n, false);
  } else {
    l.push(q, n * change + (drag - old_drag), n, false);
  }
  if (l.octet.rolls) roll(l, q, push);
  return push;
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
    for (int i = 0; i < n; ++i)
      for (int lane = 0; lane < o[i].count; lane += kWidth) {
        L l(o[i], lane, rows);
        const Moved<kPair, kRound> moved(o[i], lane, rows);
        for (int k = o[i].first; k < o[i].first + o[i].points; ++k) {
          const At q{p.point[k], p.detail[k]};
          solve_point(l, q, pass, [&](const V3& along, V speed) HWY_ATTR {
            return part(l, q, speed, moved.gap(l, q, along, pass), pass);
          });
        }
        l.store();
      }
  }
  static void relax(const Octet* o, int n, Points p, const BodyRows& rows, const Pass& pass) {
    for_each<kPair, kRound>(o, n, p, rows, true, [&](L& l, const At& q) HWY_ATTR {
      const V push =
          solve_point(l, q, pass, [&](const V3&, V speed) HWY_ATTR { return relaxed(l, q, speed); });
      store(load(q.point.total, l.lane) + push, q.point.total, l.lane);
    });
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
