#include "smartsurf/world/solver/Solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>

#include "smartsurf/world/narrowphase/Simd4.h"
#include "smartsurf/world/solver/SkinSolver.h"
#include "smartsurf/world/solver/SupportSolver.h"

namespace smartsurf::world {
namespace {

// Contact softness: frequency (Hz, at most a quarter of the substep frequency) and damping ratio of the spring that
// resolves penetration.
constexpr float kPairContactHertz = 60.0F, kStaticContactHertz = 120.0F, kDampingRatio = 5.0F;
// SubstepParams::steady_share is 1 − (substep / kSofteningTime_s)², within [0, kMaxSteadyShare]: substeps too long to settle a
// heavy body on light ones, or a tall stack, need the softness.
constexpr float kSofteningTime_s = 1.0F / 380.0F, kMaxSteadyShare = 0.95F;
constexpr float kMaxBiasVelocity = 4.0F;   // of the push-out from penetration, u/s
constexpr float kPressingNormalZ = 0.5F;   // of contacts that press a body down
constexpr float kUnusedSeparation = 1e6F;  // of unused lanes: never in contact

SubstepParams make_substep_params(float h_s, float hertz, int substeps) {
  const float omega = 2.0F * std::numbers::pi_v<float> * std::min(hertz, 0.25F / h_s);
  const float a = 2.0F * kDampingRatio + h_s * omega, b = h_s * omega * a, scale = 1.0F / (1.0F + b);
  const float length = h_s / kSofteningTime_s;
  return {h_s,
          1.0F / h_s,
          0.0F,
          omega / a,
          b * scale,
          scale,
          std::clamp(1.0F - length * length, 0.0F, kMaxSteadyShare),
          kMaxBiasVelocity,
          1.0F / static_cast<float>(substeps)};
}

void store(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}
void store(float (*to)[kLanes], int lane, const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i][lane] = from[i];
}
// The floats of Contact, and the rows of four that batches copy: normal and anchor x; anchor y, z, separation and other;
// normal and friction impulse; surface velocity and spin; rolling and total normal impulse.
constexpr std::size_t kNormalRow = 0, kAnchorRow = 16, kSurfaceRow = 36, kImpulseRow = 56, kRollingRow = 72;
static_assert(offsetof(Contact, normal) == kNormalRow && offsetof(Contact, anchor) == kAnchorRow - 4 &&
              offsetof(Contact, separation) == kAnchorRow + 8 &&
              offsetof(Contact, surface_velocity) == kSurfaceRow &&
              offsetof(Contact, surface_spin) == kSurfaceRow + 12 &&
              offsetof(Contact, normal_impulse) == kImpulseRow &&
              offsetof(Contact, friction_impulse) == kImpulseRow + 4 &&
              offsetof(Contact, rolling_impulse) == kRollingRow);
// A row of four contacts as one vector per float.
struct FourRows {
  Float4 x, y, z, w;
};
[[gnu::always_inline]] inline FourRows load_rows(const Contact* const* contacts, std::size_t row) {
  Float4 v[4];
  for (int i = 0; i < 4; ++i)
    std::memcpy(&v[i], reinterpret_cast<const char*>(contacts[i]) + row, sizeof(Float4));
  transpose4(v[0], v[1], v[2], v[3]);
  return {v[0], v[1], v[2], v[3]};
}
void store_row(const Float4& v, Contact& to, std::size_t row) {
  std::memcpy(reinterpret_cast<char*>(&to) + row, &v, sizeof(v));
}
// Of unused lanes.
const Contact kNoContact = [] {
  Contact c;
  c.normal = c.anchor = Vec3::Zero();
  c.separation = kUnusedSeparation;
  return c;
}();

Vec3 load(const float (*from)[kLanes], int lane) { return {from[0][lane], from[1][lane], from[2][lane]}; }

// Velocity change by gravity in a substep. The angular part is −0, which is neutral in floating-point addition.
BodyVelocity gravity_velocity_change(const Vec3& gravity, float h_s) {
  BodyVelocity m;
  store(m.velocity, h_s * (gravity + Vec3::Zero()));
  store(m.angular_velocity, Vec3::Constant(-0.0F));
  return m;
}

}  // namespace

struct Solver::StepContext {
  BodyStore& bodies;
  const Input& input;
  const SpatialPartition& partition;
  IndexRange own_slabs;  // of the member
  IndexRange own_rows;
  SolverBodies solver_bodies;
  SubstepParams pair_params, static_params;
  const ContactKernelTable& kernels;
  bool any_restitution;
  bool all_spheres;
  BodyVelocity gravity_change;              // per substep
  std::vector<DeepContact>& deep_contacts;  // of the member

  bool may_impact() const { return any_restitution || !all_spheres; }
  ContactList& contact_list(ContactKind kind) const {
    return is_pair(kind) ? input.pair_contacts : input.static_contacts;
  }
  static bool is_pair(ContactKind kind) { return kind == kSpherePair || kind == kGeneralPair; }
};

Solver& Solver::of_this_thread(const StepSettings& settings) {
  thread_local Solver solver(settings);
  solver.configure(settings);
  return solver;
}

void Solver::step(BodyStore& bodies, const Input& input, const Member& member) {
  const IndexRange own_slabs = input.partition.share(member);
  graph_.build(bodies, input.pair_contacts, input.pair_ranges, input.static_contacts, input.static_ranges,
               own_slabs, member);
  member.single([&] {
    has_supports_ = std::any_of(input.supports.begin(), input.supports.end(),
                                [](const SupportPatches& s) { return !s.patches.empty(); });
    resize_buffers(input.partition, member.member_count, !input.cell_limits.empty());
  });
  const float h_s = settings_.dt_s / static_cast<float>(settings_.substeps);
  const bool any_restitution = settings_.field_restitution > 0.0F ||
                               std::any_of(bodies.surface_material.begin(), bodies.surface_material.end(),
                                           [](const SurfaceMaterial& g) { return g.restitution > 0; });
  StepContext context{
      bodies,
      input,
      input.partition,
      own_slabs,
      input.partition.rows_of(own_slabs),
      solver_bodies(),
      make_substep_params(h_s, kPairContactHertz, settings_.substeps),
      make_substep_params(h_s, kStaticContactHertz, settings_.substeps),
      contact_kernels(),
      any_restitution,
      std::find(bodies.is_sphere.begin(), bodies.is_sphere.end(), 0) == bodies.is_sphere.end(),
      gravity_velocity_change(settings_.gravity, h_s),
      deep_contacts_[static_cast<std::size_t>(member.index)]};
  context.deep_contacts.clear();
  run_stages(context, member);
}

void Solver::resize_buffers(const SpatialPartition& partition, int member_count, bool has_cell_limits) {
  const auto rows = static_cast<std::size_t>(partition.row_count());
  velocity_.resize(rows);
  delta_pose_.resize(rows);
  inverse_inertia_.resize(rows);
  if (has_supports_) static_manifold_.resize(rows);
  start_velocity_.resize(rows);
  material_.resize(rows);
  point_.resize(static_cast<std::size_t>(graph_.point_count()));
  detail_.resize(point_.size());
  if (has_cell_limits) limit_.resize(point_.size());
  shared_batches_.resize(partition.row_count(), member_count);
  impacts_.reset(member_count);
  deep_contacts_.resize(static_cast<std::size_t>(member_count));
}

// Barrier protocol: every run_contact_stage() waits before a colour's shared batches and arrives after them, so that
// a member's own batches overlap with the wait. Calls outside keep arrive() and wait() balanced.
void Solver::run_stages(StepContext& context, const Member& member) {
  load_bodies(context);
  if (member.member_count > 1) shared_batches_.clear_marks(context.own_rows);
  member.arrive_and_wait();
  for (const BatchRange& run : graph_.own_batches(member))
    for (int i = run.first; i < run.first + run.count; ++i) {
      prefetch_contacts(context, run.kind, i + 1);
      prepare_batch(context, run.kind, i);
      if (context.may_impact()) find_impact_candidates(context, run.kind, i, member);
    }
  member.arrive_and_wait();
  if (member.member_count > 1)
    shared_batches_.split_batches(graph_, member);
  else
    merge_batches(graph_.own_batches(member));
  if (has_supports_) prepare_supports(context);
  integrate_velocities(context, true);
  member.arrive();
  JointSolver& joints = context.input.joints;
  const JointSolver::Substep substep{context.static_params.h_s, settings_.gravity};
  run_joint_stage(context, member,
                  [&] { joints.begin_step(context.bodies, context.partition, joint_rows()); });
  const PointRows point_rows{velocity_.data(), delta_pose_.data(), material_.data()};
  run_point_stage(context, member, [&](auto& points) {
    points.begin_step(context.bodies, context.partition, context.input.static_contacts, point_rows,
                      field_material_, context.static_params);
  });
  const ContactKernelTable& k = context.kernels;
  run_contact_stage(context, member, k.warm_start, 0.0F, SupportStage::kWarmStart);
  const float h_s = context.static_params.h_s;
  for (int s = 0; s < settings_.substeps; ++s) {
    // The caller's stages use the rows of all members, which their own batches of the warm start have written.
    if (s > 0 || !joints.empty() || !context.input.tips.empty() || !context.input.skin.empty()) {
      member.wait();
      if (s > 0) integrate_velocities(context, false);
      member.arrive();
    }
    run_joint_stage(context, member, [&] { joints.solve(context.bodies, joint_rows(), substep); });
    run_point_stage(context, member, [&](auto& points) { points.solve(point_rows); });
    run_contact_stage(context, member, k.solve, static_cast<float>(s) * h_s, SupportStage::kSolve);
    member.wait();
    integrate_positions(context);
    member.arrive();
    run_joint_stage(context, member, [&] { joints.relax(joint_rows(), substep); });
    run_point_stage(context, member, [&](auto& points) { points.relax(point_rows); });
    run_contact_stage(context, member, k.relax, 0.0F, SupportStage::kRelax);
  }
  if (has_supports_) member.wait();  // support patches change impulses in batches of other members
  for (const BatchRange& run : graph_.own_batches(member))
    for (int i = run.first; i < run.first + run.count; ++i) {
      prefetch_contacts(context, run.kind, i + 1);
      store_impulses(context, run.kind, i);
    }
  if (context.may_impact())
    member.single([&] { solve_impacts(context); });
  else
    member.arrive_and_wait();
  if (has_supports_) store_supports(context);
}

// A single member solves all batches in their order, whatever their colours: in few calls of the kernels.
void Solver::merge_batches(std::span<const BatchRange> ranges) {
  serial_batches_.clear();
  for (const BatchRange& next : ranges) {
    BatchRange* const last = serial_batches_.empty() ? nullptr : &serial_batches_.back();
    if (last != nullptr && last->kind == next.kind && last->first + last->count == next.first)
      last->count += next.count;
    else
      serial_batches_.push_back(next);
  }
}

// ---- contacts to SIMD batches and back

// Batches are in the order of colours, so their contacts lie anywhere in the list.
void Solver::prefetch_contacts(StepContext& context, ContactKind kind, int index) const {
  constexpr std::size_t kLine = 64;
  if (index >= graph_.batch_count()) return;
  const ContactList& list = context.contact_list(kind);
  for (int lane = 0; lane < graph_.lane_count(index); ++lane) {
    const auto manifold = static_cast<std::size_t>(graph_.manifold(index, lane));
    if (manifold >= list.manifolds.size()) return;  // a batch of another kind
    const Manifold& m = list.manifolds[manifold];
    const auto* const begin = reinterpret_cast<const char*>(list.contacts.data() + m.first);
    for (std::size_t at = 0; at < static_cast<std::size_t>(m.count) * sizeof(Contact); at += kLine)
      __builtin_prefetch(begin + at, 1);
  }
}

void Solver::prepare_batch(StepContext& context, ContactKind kind, int index) {
  ContactBatch& o = graph_.reset_batch(index);
  set_batch_bodies(context, o, index, kind);
  shared_batches_.mark_foreign_rows(o, context.own_rows);
  const bool all_spheres = kind == kSpherePair || kind == kSphereStatic,
             is_static = !StepContext::is_pair(kind);
  const BatchContacts contacts = contacts_of_batch(context, kind, index);
  fill_points(context, kind, o, contacts);
  if (is_static && !context.input.cell_limits.empty())
    fill_impulse_limits(context, o, index, context.contact_list(kind));
  if (is_static && !all_spheres && has_supports_)
    for (int lane = 0; lane < o.lane_count; ++lane)
      static_manifold_[static_cast<std::size_t>(o.a[lane])] = {graph_.manifold(index, lane), o.first_point,
                                                               lane, o.has_impulse_limit};
  context.kernels.prepare[kind](&o, 1, batch_points(), context.solver_bodies, context.static_params);
}

// Contacts that are about to be hit become candidates of the impact solver. They exert no impulse in the substeps,
// unless they bear a load already or the impact may exceed their force limit. Contacts without restitution do so only
// if the body lands flat, fast enough to be turned by the order in which the substeps solve the points.
void Solver::find_impact_candidates(StepContext& context, ContactKind kind, int index, const Member& member) {
  const ContactBatch& o = graph_.batch(index);
  float least_speed[kLanes] = {};
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    for (int lane = 0; lane < kLanes; ++lane)
      least_speed[lane] =
          std::min(least_speed[lane], point_[static_cast<std::size_t>(k)].approach_speed[lane]);
  const ContactList& list = context.contact_list(kind);
  const bool has_faces = kind == kGeneralPair || kind == kGeneralStatic;
  const float threshold =
      context.any_restitution ? ImpactSolver::kThreshold : ImpactSolver::kPlasticThreshold;
  for (int lane = 0; lane < o.lane_count; ++lane) {
    if (least_speed[lane] >= -threshold) continue;
    const int manifold = graph_.manifold(index, lane);
    const Manifold& m = list.manifolds[static_cast<std::size_t>(manifold)];
    constexpr float kFlatness = 0.9F;
    bool lands_flat = has_faces && m.count > 1 && least_speed[lane] < -ImpactSolver::kPlasticThreshold;
    for (int k = 0; lands_flat && k < m.count; ++k)
      lands_flat = point_[static_cast<std::size_t>(o.first_point + k)].approach_speed[lane] <
                   kFlatness * least_speed[lane];
    for (int k = 0; k < m.count; ++k) {
      BatchPoint& p = point_[static_cast<std::size_t>(o.first_point + k)];
      const float speed = p.approach_speed[lane];
      const Contact& c = list.contacts[static_cast<std::size_t>(m.first + k)];
      constexpr float kLimitMargin = 4.0F;
      const bool is_limited = !StepContext::is_pair(kind) && !context.input.cell_limits.empty() &&
                              context.input.cell_limits[static_cast<std::size_t>(m.first + k)].is_limited();
      const bool in_substeps =
          c.normal_impulse > 0.0F ||
          (is_limited && c.max_cell_impulse < -kLimitMargin * p.normal_mass[lane] * speed);
      if (speed >= (in_substeps ? -ImpactSolver::kThreshold : 0.0F)) continue;
      const float restitution = std::max(material_[static_cast<std::size_t>(o.a[lane])].restitution,
                                         material_of_b(context, m, c).restitution);
      if (restitution == 0.0F && (in_substeps || !lands_flat)) continue;
      impacts_.add(member.index, {StepContext::is_pair(kind), in_substeps, manifold, m.first + k, speed});
      if (!in_substeps) p.normal_mass[lane] = p.tangent_mass[lane] = 0.0F;
    }
  }
}

void Solver::solve_impacts(StepContext& context) {
  impacts_.solve({context.bodies, context.partition, context.input.pair_contacts,
                  context.input.static_contacts, context.input.cell_limits, field_material_, settings_.dt_s,
                  settings_.substeps, velocity_.data(), delta_pose_.data()});
}

const SurfaceMaterial& Solver::material_of_b(const StepContext& context, const Manifold& m,
                                             const Contact& c) const {
  const std::int32_t other = other_body(m, c);
  return other >= 0 ? material_[static_cast<std::size_t>(context.partition.row(other))] : field_material_;
}

// Unused lanes refer to the bodies of the first lane, so that loads stay valid; they are never stored.
void Solver::set_batch_bodies(StepContext& context, ContactBatch& o, int index, ContactKind kind) {
  const ContactList& list = context.contact_list(kind);
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(graph_.manifold(index, lane))];
    o.a[lane] = context.partition.row(m.a);
    o.b[lane] = m.b >= 0 ? context.partition.row(m.b) : o.a[lane];
  }
  std::fill(o.a + o.lane_count, o.a + kLanes, o.a[0]);
  std::fill(o.b + o.lane_count, o.b + kLanes, o.b[0]);
}

Solver::BatchContacts Solver::contacts_of_batch(const StepContext& context, ContactKind kind,
                                                int index) const {
  ContactList& list = context.contact_list(kind);
  BatchContacts of;
  for (int lane = 0; lane < graph_.lane_count(index); ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(graph_.manifold(index, lane))];
    of.manifold[lane] = &m;
    of.first[lane] = list.contacts.data() + m.first;
    of.count[lane] = m.count;
  }
  return of;
}

// Copies contacts to the points of a batch, four lanes at a time; leaves out what no kernel of the kind reads.
void Solver::fill_points(const StepContext& context, ContactKind kind, ContactBatch& o,
                         const BatchContacts& of) {
  const bool is_pair = StepContext::is_pair(kind), all_spheres = kind == kSpherePair || kind == kSphereStatic;
  const std::vector<Vec3>& position = context.bodies.position;
  struct Lanes {
    float radius_a[kLanes] = {}, radius_b[kLanes] = {}, friction[kLanes] = {}, rolling_friction[kLanes] = {};
    float position_a[3][kLanes] = {}, position_b[3][kLanes] = {};
  } lanes;
  const auto set_friction = [&](int lane, const SurfaceMaterial& b) {
    const SurfaceMaterial& a = material_[static_cast<std::size_t>(o.a[lane])];
    lanes.friction[lane] = a.friction_root * b.friction_root;
    lanes.rolling_friction[lane] = a.rolling_friction_root * b.rolling_friction_root;
    o.has_rolling_friction |= lanes.rolling_friction[lane] > 0.0F;
  };
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = *of.manifold[lane];
    lanes.radius_a[lane] = material_[static_cast<std::size_t>(o.a[lane])].radius;
    if (!is_pair) {
      for (int k = 0; k < m.count; ++k)
        if (of.has(lane, k)) set_friction(lane, material_of_b(context, m, of.first[lane][k]));
      continue;
    }
    const SurfaceMaterial& b = material_[static_cast<std::size_t>(o.b[lane])];
    lanes.radius_b[lane] = b.radius;
    set_friction(lane, b);
    if (all_spheres) continue;
    store(lanes.position_a, lane, position[static_cast<std::size_t>(m.a)]);
    store(lanes.position_b, lane, position[static_cast<std::size_t>(m.b)]);
  }
  for (int k = 0; k < o.point_count; ++k) {
    BatchPoint& p = point_[static_cast<std::size_t>(o.first_point + k)];
    BatchPointDetail& d = detail_[static_cast<std::size_t>(o.first_point + k)];
    const Contact* c[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      c[lane] = of.has(lane, k) ? of.first[lane] + k : &kNoContact;
      if (is_pair || !of.has(lane, k)) continue;
      set_friction(lane, material_of_b(context, *of.manifold[lane], *c[lane]));
      if (c[lane]->partner == Partner::kSupportedCell)
        lanes.friction[lane] = 0.0F;  // the patch has the friction
    }
    for (int lane = 0; lane < kLanes; lane += kSimd4Width) {
      const Contact* const* const four = c + lane;
      const auto put = [lane](const Float4& values, float* to) { store4(values, to + lane); };
      const FourRows first = load_rows(four, kNormalRow), impulses = load_rows(four, kImpulseRow);
      put(first.x, p.normal[0]), put(first.y, p.normal[1]), put(first.z, p.normal[2]);
      put(impulses.x, p.normal_impulse);
      put(impulses.y, p.friction_impulse[0]), put(impulses.z, p.friction_impulse[1]);
      put(impulses.w, p.friction_impulse[2]);
      put(load4(lanes.friction + lane), p.friction);
      put(Float4{}, p.total_normal_impulse), put(Float4{}, p.relax_target_speed);
      if (all_spheres) {
        put(load4(lanes.radius_a + lane), p.radius_a), put(load4(lanes.radius_b + lane), p.radius_b);
        put(Float4{four[0]->separation, four[1]->separation, four[2]->separation, four[3]->separation},
            p.separation);
      } else {
        const FourRows second = load_rows(four, kAnchorRow);
        put(second.z, p.separation);
        put(impulses.x, d.start_impulse);
        const Float4 anchor[3] = {first.w, second.x, second.y};
        for (int i = 0; i < 3; ++i) {
          put(anchor[i], d.anchor_a[i]);
          if (is_pair)
            put((load4(lanes.position_a[i] + lane) + anchor[i]) - load4(lanes.position_b[i] + lane),
                d.anchor_b[i]);
        }
      }
      if (!is_pair) {
        const FourRows surface = load_rows(four, kSurfaceRow);
        put(surface.x, d.surface_velocity[0]), put(surface.y, d.surface_velocity[1]);
        put(surface.z, d.surface_velocity[2]), put(surface.w, d.surface_spin);
      }
      if (o.has_rolling_friction) {
        const FourRows rolling = load_rows(four, kRollingRow);
        put(rolling.x, d.rolling_impulse[0]), put(rolling.y, d.rolling_impulse[1]);
        put(rolling.z, d.rolling_impulse[2]);
        put(load4(lanes.rolling_friction + lane), d.rolling_friction);
      }
    }
    // Joints and contacts are solved apart and settle only with the softness.
    for (int lane = 0; !all_spheres && lane < o.lane_count; ++lane) {
      const Manifold& m = *of.manifold[lane];
      if (context.bodies.is_jointed[static_cast<std::size_t>(m.a)] ||
          (m.b >= 0 && context.bodies.is_jointed[static_cast<std::size_t>(m.b)]))
        d.start_impulse[lane] = 0.0F;
    }
    for (int lane = 0; !is_pair && lane < o.lane_count; ++lane)
      if (c[lane]->partner == Partner::kSupportedCell) store(p.friction_impulse, lane, Vec3::Zero());
  }
}

void Solver::fill_impulse_limits(const StepContext& context, ContactBatch& o, int index,
                                 const ContactList& list) {
  auto limit_of = [&](const Manifold& m, int k) -> const CellImpulseLimit& {
    return context.input.cell_limits[static_cast<std::size_t>(m.first + k)];
  };
  for (int lane = 0; lane < o.lane_count && !o.has_impulse_limit; ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(graph_.manifold(index, lane))];
    for (int k = 0; k < m.count; ++k) o.has_impulse_limit |= limit_of(m, k).is_limited();
  }
  if (!o.has_impulse_limit) return;
  const auto first = static_cast<std::size_t>(o.first_point);
  std::fill_n(&limit_[first], o.point_count, BatchPointLimit());
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(graph_.manifold(index, lane))];
    for (int k = 0; k < m.count; ++k) {
      const CellImpulseLimit& limit = limit_of(m, k);
      if (!limit.is_limited()) continue;
      const Contact& c = list.contacts[static_cast<std::size_t>(m.first + k)];
      BatchPointLimit& p = limit_[first + static_cast<std::size_t>(k)];
      p.stall_impulse[lane] = c.max_cell_impulse * context.static_params.substep_fraction;
      p.no_load_speed[lane] = limit.no_load_speed;
      p.planned_speed[lane] = limit.planned_speed;
      p.to_first[lane] = limit.to_first;
      BatchPointLimit& cell = limit_[first + static_cast<std::size_t>(k + limit.to_first)];
      cell.load[lane] += c.normal_impulse * c.normal.z();
      for (int axis = 0; axis < 3; ++axis)
        cell.anchor[axis][lane] += c.anchor[axis] / static_cast<float>(limit.point_count);
    }
  }
}

void Solver::store_impulses(StepContext& context, ContactKind kind, int index) {
  const ContactBatch& o = graph_.batch(index);
  const BatchContacts of = contacts_of_batch(context, kind, index);
  float depth[kLanes];
  std::fill_n(depth, kLanes, context.input.deep_contact);
  for (int k = 0; k < o.point_count; ++k) {
    const BatchPoint& p = point_[static_cast<std::size_t>(o.first_point + k)];
    const BatchPointDetail& d = detail_[static_cast<std::size_t>(o.first_point + k)];
    for (int lane = 0; lane < kLanes; lane += kSimd4Width) {
      store4(max(load4(depth + lane), -load4(p.separation + lane)), depth + lane);
      Float4 row[kSimd4Width] = {load4(p.normal_impulse + lane), load4(p.friction_impulse[0] + lane),
                                 load4(p.friction_impulse[1] + lane), load4(p.friction_impulse[2] + lane)};
      transpose4(row[0], row[1], row[2], row[3]);
      for (int i = 0; i < kSimd4Width; ++i)
        if (of.has(lane + i, k)) store_row(row[i], of.first[lane + i][k], kImpulseRow);
    }
    for (int lane = 0; lane < o.lane_count; ++lane) {
      if (!of.has(lane, k)) continue;
      Contact& c = of.first[lane][k];
      c.total_normal_impulse = p.total_normal_impulse[lane];
      if (o.has_rolling_friction) c.rolling_impulse = load(d.rolling_impulse, lane);
    }
  }
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = *of.manifold[lane];
    if (depth[lane] > context.input.deep_contact) {
      const Contact& deepest = *std::min_element(
          of.first[lane], of.first[lane] + m.count,
          [](const Contact& one, const Contact& other) { return one.separation < other.separation; });
      // Spheres roll off each other.
      const float upward = kind == kSpherePair ? 0.0F : deepest.normal.z();
      context.deep_contacts.push_back({m.a, depth[lane], upward < -kPressingNormalZ});
      if (m.b >= 0) context.deep_contacts.push_back({m.b, depth[lane], upward > kPressingNormalZ});
    }
    if (!o.has_impulse_limit || StepContext::is_pair(kind)) continue;
    for (int k = 0; k < m.count; ++k) {
      CellImpulseLimit& limit = context.input.cell_limits[static_cast<std::size_t>(m.first + k)];
      if (limit.to_first == 0)
        limit.capacity = limit_[static_cast<std::size_t>(o.first_point + k)].step_capacity[lane];
    }
  }
}

// ---- bodies, each member those of its slabs

template <class Each>
void Solver::for_each_active_range(const StepContext& context, Each each) const {
  for (int s = context.own_slabs.begin; s < context.own_slabs.end; ++s)
    if (const IndexRange rows = context.partition.active_rows_of(s); rows.begin < rows.end) each(rows);
}

void Solver::load_bodies(StepContext& context) {
  constexpr int kPrefetchDistance = 8;  // in rows: about one memory latency
  const BodyStore& b = context.bodies;
  for (int s = context.own_slabs.begin; s < context.own_slabs.end; ++s) {
    const IndexRange rows = context.partition.rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const auto to = static_cast<std::size_t>(row);
      const std::size_t from = context.partition.body(row);
      if (row + kPrefetchDistance < rows.end) b.prefetch(context.partition.body(row + kPrefetchDistance));
      velocity_[to] = b.body_velocity[from];
      material_[to] = b.surface_material[from];
      if (!context.all_spheres) inverse_inertia_[to] = b.world_inverse_inertia[from];
      delta_pose_[to] = {};
    }
  }
}

// Velocity change by gravity and the body's wrench in a substep.
BodyVelocity Solver::external_velocity_change(const StepContext& context, int row) const {
  const std::size_t body = context.partition.body(row);
  const surface::Wrench& w = context.bodies.wrench[body];
  const float h_s = context.static_params.h_s;
  BodyVelocity m = context.gravity_change;
  store(m.velocity,
        h_s * (settings_.gravity + velocity_[static_cast<std::size_t>(row)].inverse_mass * w.force));
  if (!w.torque.isZero(0.0F)) {
    const InverseInertia& q = context.bodies.world_inverse_inertia[body];
    store(m.angular_velocity,
          h_s * Vec3(Vec3(q.xx, q.xy, q.xz).dot(w.torque), Vec3(q.xy, q.yy, q.yz).dot(w.torque),
                     Vec3(q.xz, q.yz, q.zz).dot(w.torque)));
  }
  return m;
}

// Also warm-starts all substeps but the first: normals and anchors are constant during the step, so re-applying the
// accumulated impulses equals repeating the velocity change that contacts caused in the last substep.
void Solver::integrate_velocities(StepContext& context, bool first) {
  const auto integrate = [&](IndexRange rows, const BodyVelocity& change) {
    context.kernels.integrate_velocities(rows.begin, rows.end, change, first, velocity_.data(),
                                         start_velocity_.data());
  };
  for_each_active_range(context, [&](IndexRange rows) {
    if (!context.input.has_wrenches) return integrate(rows, context.gravity_change);
    for (int row = rows.begin; row < rows.end; ++row)
      integrate({row, row + 1}, external_velocity_change(context, row));
  });
}

void Solver::integrate_positions(StepContext& context) {
  for_each_active_range(context, [&](IndexRange rows) {
    context.kernels.integrate_positions(rows.begin, rows.end, context.static_params.h_s, velocity_.data(),
                                        delta_pose_.data());
  });
}

void Solver::store_body(BodyStore& bodies, const SpatialPartition& partition, int row) const {
  const std::size_t to = partition.body(row);
  bodies.body_velocity[to] = velocity_[static_cast<std::size_t>(row)];
  bodies.delta_pose[to] = delta_pose_[static_cast<std::size_t>(row)];
}

// ---- one stage over all contacts: pairs colour by colour; static contacts last, because they must hold exactly

void Solver::run_contact_stage(StepContext& context, const Member& member,
                               const ContactKernel (&kernel)[kContactKindCount], float elapsed_s,
                               SupportStage support_stage) {
  SubstepParams &pair_params = context.pair_params, &static_params = context.static_params;
  pair_params.elapsed_s = static_params.elapsed_s = elapsed_s;
  const auto run = [&](std::span<const BatchRange> ranges) {
    for (const BatchRange& batches : ranges)
      kernel[batches.kind](graph_.batches_from(batches.first), batches.count, batch_points(),
                           context.solver_bodies,
                           StepContext::is_pair(batches.kind) ? pair_params : static_params);
  };
  if (member.member_count == 1) {
    run(serial_batches_);
  } else {
    for (std::size_t i = 0; i <= graph_.colours().size(); ++i) {
      member.wait();
      run(shared_batches_.shared(member, i));
      member.arrive();
      run(shared_batches_.own(member, i));
    }
  }
  if (!has_supports_) return;
  member.wait();
  for_each_own_support(context, [&](SupportPatches& list, SupportPatch& p) {
    const auto row = static_cast<std::size_t>(p.row);
    if (support_stage == SupportStage::kWarmStart)
      return warm_start_support(p, velocity_[row], inverse_inertia_[row]);
    const bool is_soft = support_stage == SupportStage::kSolve;
    auto solve_points = [&] {
      solve_support_points(list, p, batch_points(), static_params, is_soft, velocity_[row], delta_pose_[row],
                           inverse_inertia_[row]);
    };
    solve_points();
    solve_support(list, p, batch_points(), is_soft, velocity_[row], inverse_inertia_[row]);
    // Friction tilts the body: again, because the normal constraints must hold at the end of the step.
    if (is_soft) return;
    solve_points();
    share_loads(list, p, batch_points());
  });
  member.arrive();
}

// Contacts with what gives way are solved by the caller alone, as joints are. stage(solver): of each such solver with
// contacts.
template <class Stage>
void Solver::run_point_stage(const StepContext& context, const Member& member, Stage stage) {
  TipSolver& tips = context.input.tips;
  SkinSolver& skin = context.input.skin;
  if (tips.empty() && skin.empty()) return;
  member.wait();
  if (member.is_caller() && !tips.empty()) stage(tips);
  if (member.is_caller() && !skin.empty()) stage(skin);
  member.arrive();
}

// Joints are solved by the caller alone.
template <class Stage>
void Solver::run_joint_stage(const StepContext& context, const Member& member, Stage stage) {
  if (context.input.joints.empty()) return;
  member.wait();
  if (member.is_caller()) stage();
  member.arrive();
}

// ---- support patches, each member those of its slabs

template <class Each>
void Solver::for_each_own_support(const StepContext& context, Each each) const {
  for (int s = context.own_slabs.begin; s < context.own_slabs.end; ++s) {
    SupportPatches& list = context.input.supports[static_cast<std::size_t>(s)];
    for (SupportPatch& p : list.patches) each(list, p);
  }
}

std::span<Contact> Solver::contacts_of_row(StepContext& context, int row) const {
  ContactList& list = context.input.static_contacts;
  const Manifold& m =
      list.manifolds[static_cast<std::size_t>(static_manifold_[static_cast<std::size_t>(row)].manifold)];
  return std::span(list.contacts)
      .subspan(static_cast<std::size_t>(m.first), static_cast<std::size_t>(m.count));
}

void Solver::prepare_supports(StepContext& context) {
  for_each_own_support(context, [&](SupportPatches& list, SupportPatch& p) {
    p.row = context.partition.row(p.body);
    const auto row = static_cast<std::size_t>(p.row);
    p.batch_point = static_manifold_[row].batch_point;
    p.lane = static_manifold_[row].lane;
    p.has_impulse_limit = static_manifold_[row].has_impulse_limit;
    prepare_support(list, p, velocity_[row], inverse_inertia_[row],
                    material_[row].friction_root * field_material_.friction_root,
                    context.static_params.substep_fraction, contacts_of_row(context, p.row));
  });
}

void Solver::store_supports(StepContext& context) {
  for_each_own_support(context, [&](SupportPatches& list, SupportPatch& p) {
    store_support(list, p, contacts_of_row(context, p.row));
  });
}

}  // namespace smartsurf::world
