// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/solver/ContactKernels.h"

#include "smartsurf/world/field/CellForceLimits.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/solver/ContactKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/solver/ContactLanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

template <bool kPair, bool kSpheres>
HWY_INLINE void prepare_point(const ContactLanes<kPair, kSpheres>& l, const PointRef& q) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  V inverse_mass_sum = l.a.inverse_mass;
  if constexpr (kPair) inverse_mass_sum = inverse_mass_sum + l.b.inverse_mass;
  V normal_k, tangent_k, rolling_k;
  if constexpr (kSpheres) {
    const V ra = load(q.point.radius_a, at);
    normal_k = inverse_mass_sum;
    tangent_k = inverse_mass_sum + l.a.inverse_inertia * ra * ra;
    rolling_k = l.a.inverse_inertia;
    if constexpr (kPair) {
      const V rb = load(q.point.radius_b, at);
      tangent_k = tangent_k + l.b.inverse_inertia * rb * rb;
      rolling_k = rolling_k + l.b.inverse_inertia;
    }
  } else {
    normal_k = l.inverse_effective_mass(q, n, n, inverse_mass_sum);
    V3 t, u;
    tangents(n, t, u);
    const V tt = l.inverse_effective_mass(q, t, t, inverse_mass_sum),
            uu = l.inverse_effective_mass(q, u, u, inverse_mass_sum),
            tu = l.inverse_effective_mass(q, t, u, zero());
    tangent_k = greatest_tangent_response(tt, uu, tu);
    const V3 response = l.angular_response(q, n);
    store3(response - n * dot(n, response), q.detail.slip_per_impulse, at);
    rolling_k = sum3(l.inertia_a.xx, l.inertia_a.yy, l.inertia_a.zz);
    if constexpr (kPair) rolling_k = rolling_k + sum3(l.inertia_b.xx, l.inertia_b.yy, l.inertia_b.zz);
  }
  store(inverse(normal_k), q.point.normal_mass, at);
  store(inverse(tangent_k), q.point.tangent_mass, at);
  if (l.batch.has_rolling_friction) store(inverse(rolling_k), q.detail.rolling_mass, at);
  store(dot(n, l.relative_velocity(q, n)), q.point.approach_speed, at);
}

template <bool kPair, bool kSpheres>
HWY_INLINE void warm_start_point(ContactLanes<kPair, kSpheres>& l, const PointRef& q) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  l.apply_impulse(q, n * load(q.point.normal_impulse, at), n, true);
  l.apply_impulse(q, load3(q.point.friction_impulse, at), n, false);
  if (l.batch.has_rolling_friction) l.apply_angular_impulse(load3(q.detail.rolling_impulse, at));
}

template <bool kPair, bool kSpheres>
HWY_INLINE void solve_rolling(ContactLanes<kPair, kSpheres>& l, const PointRef& q, V normal_impulse) {
  const int at = l.lane;
  const V3 old_impulse = load3(q.detail.rolling_impulse, at);
  const V3 impulse =
      friction_impulse(old_impulse, l.relative_angular_velocity(q), load(q.detail.rolling_mass, at),
                       load(q.detail.rolling_friction, at) * normal_impulse);
  store3(impulse, q.detail.rolling_impulse, at);
  l.apply_angular_impulse(impulse - old_impulse);
}

// Solve stage. Sets relax_target_speed.
template <bool kPair, bool kSpheres>
HWY_INLINE V solve_normal(const ContactLanes<kPair, kSpheres>& l, const PointRef& q, V speed, V separation,
                          const SubstepParams& params) {
  const int at = l.lane;
  const V target_speed = push_out_speed(separation, params, slop_of(l.kKind));
  store(relax_target_speed(separation, target_speed), q.point.relax_target_speed, at);
  const V old_impulse = load(q.point.normal_impulse, at);
  V deflecting = old_impulse;
  if constexpr (!kSpheres)
    deflecting = deflecting_impulse(old_impulse, load(q.detail.steady_impulse, at), params);
  const V impulse = soft_normal_impulse(old_impulse, load(q.point.normal_mass, at), speed, target_speed,
                                        separation, deflecting, params);
  if constexpr (!kSpheres) {
    const V steady = load(q.detail.steady_impulse, at);
    store(steady + (impulse - steady) * set(params.steady_gain), q.detail.steady_impulse, at);
  }
  return impulse;
}

// A sum over the points of the body on the cell, from the first of them.
HWY_INLINE V load_of_cell(const PointRef& q, int lane, float (BatchPointLimit::*sum)[kLanes]) {
  alignas(32) float values[kVectorWidth];
  for (int i = 0; i < kVectorWidth; ++i) values[i] = (q.limit[q.limit->to_first[lane + i]].*sum)[lane + i];
  return load(values, 0);
}
HWY_INLINE void store_of_cell(V value, const PointRef& q, int lane, float (BatchPointLimit::*sum)[kLanes]) {
  alignas(32) float values[kVectorWidth];
  store(value, values, 0);
  for (int i = 0; i < kVectorWidth; ++i) (q.limit[q.limit->to_first[lane + i]].*sum)[lane + i] = values[i];
}

// Solves the motor's line, impulse(speed), together with the body's response, speed = v + (impulse − load)·k,
// for the impulse that each cell can give in the substep and for its speed. Only the values at a cell's first
// point are used.
template <bool kPair, bool kSpheres>
HWY_INLINE void update_cell_motion(const ContactLanes<kPair, kSpheres>& l, const PointRef& q) {
  const int at = l.lane;
  const V3 anchor = load3(q.limit->anchor, at);
  const V speed = l.a.velocity.z + (l.a.angular_velocity.x * anchor.y - l.a.angular_velocity.y * anchor.x);
  const V3 lever = {anchor.y, zero() - anchor.x, zero()};  // anchor × ẑ
  V k;
  if constexpr (kSpheres)
    k = l.a.inverse_mass + l.a.inverse_inertia * dot(lever, lever);
  else
    k = l.a.inverse_mass + dot(lever, l.inertia_a * lever);
  const V stall_impulse = load(q.limit->stall_impulse, at), no_load_speed = load(q.limit->no_load_speed, at);
  const V droop = stall_impulse / no_load_speed;  // of the impulse per speed
  const V old_load = load(q.limit->load, at);
  const V impulse = (stall_impulse - droop * speed + droop * k * old_load) / (set(1.0F) + droop * k);
  const V capacity = hn::Max(hn::Min(impulse, stall_impulse), zero());
  store(capacity, q.limit->capacity, at);
  store(hn::Min(speed + (capacity - old_load) * k, load(q.limit->planned_speed, at)), q.limit->speed, at);
}

// Adds the lag of the last substep at the cell's first point; called at the start of a substep. A cell yields
// to a load that takes nearly all of its capacity.
HWY_INLINE void update_cell_lag(const PointRef& q, int at, const SubstepParams& params) {
  if (params.elapsed_s == 0.0F) return;
  const auto yields = hn::Ge(load(q.limit->load, at), load(q.limit->capacity, at) * set(kYieldingLoad));
  const V slower = load(q.limit->planned_speed, at) - load(q.limit->speed, at);
  store(load(q.limit->lag, at) + hn::IfThenElseZero(yields, slower) * set(params.h_s), q.limit->lag, at);
}

// Bounds a normal impulse by what the cell's other points leave of its capacity.
HWY_INLINE V bound_by_cell_force(const PointRef& q, int at, const V3& n, V impulse) {
  const V others = load_of_cell(q, at, &BatchPointLimit::load) - load(q.point.normal_impulse, at) * n.z;
  const V available = hn::Max(load_of_cell(q, at, &BatchPointLimit::capacity) - others, zero()) / n.z;
  const auto is_limited = hn::Lt(load(q.limit->stall_impulse, at), set(BatchPointLimit::kUnlimited));
  const V bounded = hn::IfThenElse(is_limited, hn::Min(impulse, available), impulse);
  store_of_cell(others + bounded * n.z, q, at, &BatchPointLimit::load);
  return bounded;
}

// Adds the capacity of a cell to that of the step, at the cell's first point; called at the end of a substep.
HWY_INLINE void add_to_step_capacity(const PointRef& q, int at) {
  store(load(q.limit->step_capacity, at) + load(q.limit->capacity, at), q.limit->step_capacity, at);
}

// Solves the normal constraint, then friction within the cone of the new normal impulse, then rolling
// friction. Returns the normal impulse. For general shapes the normal impulse also changes the slip, which
// slip_per_impulse accounts for, so that both impulses can be applied at once; for spheres the two are
// independent.
template <bool kPair, bool kSpheres, class ComputeImpulse>
HWY_INLINE V solve_point(ContactLanes<kPair, kSpheres>& l, const PointRef& q,
                         ComputeImpulse compute_impulse) {
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  V3 velocity = l.relative_velocity(q, n);
  if (!kPair && l.batch.has_impulse_limit) {
    update_cell_motion(l, q);
    velocity.z = velocity.z + load(q.limit->planned_speed, at) - load_of_cell(q, at, &BatchPointLimit::speed);
  }
  const V speed = dot(n, velocity);
  V impulse = compute_impulse(n, speed);
  if (!kPair && l.batch.has_impulse_limit) impulse = bound_by_cell_force(q, at, n, impulse);
  const V impulse_change = impulse - load(q.point.normal_impulse, at);
  store(impulse, q.point.normal_impulse, at);
  V3 slip = velocity - n * speed;
  if constexpr (!kSpheres) slip = slip + load3(q.detail.slip_per_impulse, at) * impulse_change;
  const V3 old_friction = load3(q.point.friction_impulse, at);
  V3 friction = old_friction - slip * load(q.point.tangent_mass, at);
  // Without friction clamped to 0, by no root and quotient for which the next point would wait.
  if (!kPair && !kSpheres && !l.batch.has_friction && !l.batch.has_impulse_limit)
    friction = friction * zero();
  else
    friction = clamp_length(friction, load(q.point.friction, at) * impulse);
  store3(friction, q.point.friction_impulse, at);
  if constexpr (kSpheres) {
    l.apply_impulse(q, n * impulse_change, n, true);
    l.apply_impulse(q, friction - old_friction, n, false);
  } else {
    l.apply_impulse(q, n * impulse_change + (friction - old_friction), n, false);
  }
  if (l.batch.has_rolling_friction) solve_rolling(l, q, impulse);
  return impulse;
}

// Relax stage: without softness and push-out.
template <bool kPair, bool kSpheres>
HWY_INLINE void relax_point(ContactLanes<kPair, kSpheres>& l, const PointRef& q) {
  const V impulse = solve_point(l, q, [&](const V3&, V speed) HWY_ATTR {
    return normal_impulse(load(q.point.normal_impulse, l.lane), load(q.point.normal_mass, l.lane), speed,
                          load(q.point.relax_target_speed, l.lane));
  });
  store(load(q.point.total_normal_impulse, l.lane) + impulse, q.point.total_normal_impulse, l.lane);
  if (!kPair && l.batch.has_impulse_limit) add_to_step_capacity(q, l.lane);
}

// A kernel that does kPointWork, a function of lanes and point.
template <bool kPair, bool kSpheres, auto kPointWork>
void for_each_point(const ContactBatch* batches, int count, BatchPoints points, const SolverBodies& rows,
                    const SubstepParams&) {
  for (int i = 0; i < count; ++i)
    for (int lane = 0; lane < batches[i].lane_count; lane += kVectorWidth) {
      ContactLanes<kPair, kSpheres> l(batches[i], lane, rows);
      for (int k = batches[i].first_point; k < batches[i].first_point + batches[i].point_count; ++k)
        kPointWork(l, point_ref(points, k));
      l.store();
    }
}

// Lowers the friction of a face patch's corners by the share of a twist in the patch's last friction: see
// Contact::twist_friction_loss.
template <bool kPair, bool kSpheres>
HWY_INLINE void lower_friction_of_twist(const ContactLanes<kPair, kSpheres>& l, const ContactBatch& o,
                                        const BatchPoints& points) {
  const int at = l.lane;
  const V least = set(1e-20F), one = set(1.0F);
  // The centre of the load of the last step, or of the points where there was none.
  V sum = zero();
  V3 moment{zero(), zero(), zero()}, force = moment;
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
    const PointRef q = point_ref(points, k);
    const V weight = if_positive(load(q.detail.twist_friction_loss, at),
                                 hn::Max(load(q.point.normal_impulse, at), least), zero());
    sum = sum + weight;
    moment = moment + l.anchor_a(q) * weight;
    force = force + load3(q.point.friction_impulse, at);
  }
  const V3 centre = moment * (one / hn::Max(sum, least));
  V torque = zero();
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
    const PointRef q = point_ref(points, k);
    torque = torque + dot(load3(q.point.normal, at),
                          cross(l.anchor_a(q) - centre, load3(q.point.friction_impulse, at)));
  }
  const V squared = torque * torque, force_squared = dot(force, force);
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
    const PointRef q = point_ref(points, k);
    const V3 arm = l.anchor_a(q) - centre;
    const V twist = squared / hn::Max(squared + force_squared * dot(arm, arm), least);
    const V kept = one - load(q.detail.twist_friction_loss, at) * twist;
    store(load(q.point.friction, at) * kept, q.point.friction, at);
  }
}

template <bool kPair, bool kSpheres>
void prepare(const ContactBatch* batches, int count, BatchPoints points, const SolverBodies& rows,
             const SubstepParams&) {
  for (int i = 0; i < count; ++i)
    for (int lane = 0; lane < batches[i].lane_count; lane += kVectorWidth) {
      const ContactLanes<kPair, kSpheres> l(batches[i], lane, rows);
      if (!kSpheres && batches[i].has_face_patch) lower_friction_of_twist(l, batches[i], points);
      for (int k = batches[i].first_point; k < batches[i].first_point + batches[i].point_count; ++k)
        prepare_point(l, point_ref(points, k));
    }
}

// Moves a point that rolls on to a substep: the velocity of b's surface to the middle of it, the separation
// to its start. A point of a pair that does not roll is carried by the larger body.
template <bool kPair>
HWY_INLINE void move_point(const ContactLanes<kPair, false>& l, const PointRef& q, const V3& carrying,
                           const SubstepParams& params) {
  if (!kPair && !l.batch.has_moving_points) return;
  const int at = l.lane;
  const V3 n = load3(q.point.normal, at);
  const V3 carried = carrying - n * dot(n, carrying);
  if (!l.batch.has_moving_points) return store3(carried, q.detail.surface_velocity, at);
  const bool is_first = params.elapsed_s == 0.0F;
  const V3 acceleration = load3(q.detail.surface_acceleration, at),
           velocity = load3(q.detail.surface_velocity, at);
  const V3 next = velocity + acceleration * set(is_first ? 0.5F * params.h_s : params.h_s);
  V closing;  // since the start of the last substep; of a static surface, beyond its velocity × elapsed time
  if constexpr (kPair) {
    const V rolls = dot(acceleration, acceleration);
    closing = if_positive(rolls, dot(n, velocity) * set(is_first ? 0.0F : params.h_s), zero());
    store3({if_positive(rolls, next.x, carried.x), if_positive(rolls, next.y, carried.y),
            if_positive(rolls, next.z, carried.z)},
           q.detail.surface_velocity, at);
  } else {
    closing = dot(n, acceleration) * set(-params.elapsed_s * params.h_s);
    store3(next, q.detail.surface_velocity, at);
  }
  store(load(q.point.separation, at) - closing, q.point.separation, at);
}

template <bool kPair, bool kSpheres>
void solve(const ContactBatch* o, int n, BatchPoints p, const SolverBodies& rows,
           const SubstepParams& params) {
  for (int i = 0; i < n; ++i)
    for (int lane = 0; lane < o[i].lane_count; lane += kVectorWidth) {
      ContactLanes<kPair, kSpheres> l(o[i], lane, rows);
      const DeltaPoseLanes<kPair, kSpheres> delta(o[i], lane, rows);
      V3 carrying{zero(), zero(), zero()};
      if constexpr (kPair && !kSpheres)
        carrying = delta.carrying_velocity(l, point_ref(p, o[i].first_point), params);
      for (int k = o[i].first_point; k < o[i].first_point + o[i].point_count; ++k) {
        const PointRef q = point_ref(p, k);
        if (!kPair && o[i].has_impulse_limit) update_cell_lag(q, lane, params);
        if constexpr (!kSpheres) move_point(l, q, carrying, params);
        solve_point(l, q, [&](const V3& along, V speed) HWY_ATTR {
          V separation = delta.separation(l, q, along, params);
          if (!kPair && o[i].has_impulse_limit)
            separation = separation + along.z * load_of_cell(q, lane, &BatchPointLimit::lag);
          return solve_normal(l, q, speed, separation, params);
        });
      }
      l.store();
    }
}

template <bool kPair, bool kSpheres>
void add_kernels(ContactKernelTable& t) {
  constexpr ContactKind kind = ContactLanes<kPair, kSpheres>::kKind;
  t.prepare[kind] = prepare<kPair, kSpheres>;
  t.warm_start[kind] = for_each_point<kPair, kSpheres, warm_start_point<kPair, kSpheres>>;
  t.solve[kind] = solve<kPair, kSpheres>;
  t.relax[kind] = for_each_point<kPair, kSpheres, relax_point<kPair, kSpheres>>;
}

// ---- rows of bodies

static_assert(sizeof(BodyVelocity) == kRow * sizeof(float) && sizeof(DeltaPose) == kRow * sizeof(float));
// 1 for the floats of a BodyVelocity that integration changes. The others are the inverse mass and inertia.
constexpr float kIsVelocity[kRow] = {1, 1, 1, 0, 1, 1, 1, 0};

// Calls work(i, moves) for the vectors of the rows, i being the index of the first float in the array and
// `moves` the mask of the floats that are velocities.
template <class Work>
HWY_INLINE void for_each_row_vector(int begin, int end, Work work) {
  for (int row = begin; row < end; ++row)
    for (int column = 0; column < kRow; column += kVectorWidth)
      work(std::ptrdiff_t{row} * kRow + column, hn::Ne(load(kIsVelocity, column), zero()));
}

void integrate_velocities(int begin, int end, const BodyVelocity& change, bool first, BodyVelocity* velocity,
                          BodyVelocity* start_velocity) {
  auto *const speeds = reinterpret_cast<float*>(velocity), *const start_speeds =
                                                               reinterpret_cast<float*>(start_velocity);
  const auto* const changes = reinterpret_cast<const float*>(&change);
  const V low = set(-kMaxSpeed), high = set(kMaxSpeed);
  for_each_row_vector(begin, end, [&](std::ptrdiff_t i, auto moves) HWY_ATTR {
    const V speed = hn::LoadU(Tag(), speeds + i), contact_change = speed - hn::LoadU(Tag(), start_speeds + i);
    const V changed = speed + hn::LoadU(Tag(), changes + i % kRow);
    const V at_least_low = hn::IfThenElse(hn::Lt(changed, low), low, changed);
    const V start = hn::IfThenElse(hn::Lt(high, at_least_low), high, at_least_low);
    hn::StoreU(start, Tag(), start_speeds + i);
    hn::StoreU(hn::IfThenElse(moves, first ? start : start + contact_change, speed), Tag(), speeds + i);
  });
}

void integrate_positions(int begin, int end, float h_s, const BodyVelocity* velocity, DeltaPose* delta_pose) {
  const auto* const speeds = reinterpret_cast<const float*>(velocity);
  auto* const poses = reinterpret_cast<float*>(delta_pose);
  for_each_row_vector(begin, end, [&](std::ptrdiff_t i, auto moves) HWY_ATTR {
    const V step = hn::IfThenElseZero(moves, set(h_s)) * hn::LoadU(Tag(), speeds + i);
    hn::StoreU(hn::LoadU(Tag(), poses + i) + step, Tag(), poses + i);
  });
}

// Rounds as the two kernels above do.
void integrate_free(int begin, int end, int substeps, float h_s, const BodyVelocity& change,
                    BodyVelocity* velocity, DeltaPose* delta_pose) {
  auto *const speeds = reinterpret_cast<float*>(velocity), *const poses =
                                                               reinterpret_cast<float*>(delta_pose);
  const auto* const changes = reinterpret_cast<const float*>(&change);
  const V low = set(-kMaxSpeed), high = set(kMaxSpeed);
  for_each_row_vector(begin, end, [&](std::ptrdiff_t i, auto moves) HWY_ATTR {
    const V time = hn::IfThenElseZero(moves, set(h_s)), added = hn::LoadU(Tag(), changes + i % kRow);
    V speed = hn::LoadU(Tag(), speeds + i), start = speed, pose = hn::LoadU(Tag(), poses + i);
    for (int s = 0; s < substeps; ++s) {
      const V contact_change = speed - start, changed = speed + added;
      const V at_least_low = hn::IfThenElse(hn::Lt(changed, low), low, changed);
      start = hn::IfThenElse(hn::Lt(high, at_least_low), high, at_least_low);
      speed = hn::IfThenElse(moves, s == 0 ? start : start + contact_change, speed);
      pose = pose + time * speed;
    }
    hn::StoreU(speed, Tag(), speeds + i);
    hn::StoreU(pose, Tag(), poses + i);
  });
}

const ContactKernelTable* table() {
  static const ContactKernelTable kTable = [] {
    ContactKernelTable t{};
    add_kernels<true, true>(t);
    add_kernels<true, false>(t);
    add_kernels<false, true>(t);
    add_kernels<false, false>(t);
    t.integrate_velocities = integrate_velocities;
    t.integrate_positions = integrate_positions;
    t.integrate_free = integrate_free;
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

const ContactKernelTable& contact_kernels() { return *HWY_DYNAMIC_DISPATCH(table)(); }

}  // namespace smartsurf::world
#endif
