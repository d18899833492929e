#include "smartsurf/world/solver/Solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/world/contact/ContactMaterial.h"
#include "smartsurf/world/solver/SupportPoints.h"
#include "smartsurf/world/solver/SupportSprings.h"

namespace smartsurf::world {
namespace {

// Contact softness: frequency (Hz, at most a quarter of the substep frequency) and damping ratio of the
// spring that resolves penetration.
constexpr float kPairContactHertz = 60.0F, kStaticContactHertz = 120.0F, kDampingRatio = 5.0F;
// SubstepParams::steady_share is 1 − (substep / kSofteningTime_s)², within [0, kMaxSteadyShare]: substeps too
// long to settle a heavy body on light ones, or a tall stack, need the softness.
constexpr float kSofteningTime_s = 1.0F / 380.0F, kMaxSteadyShare = 0.95F;
constexpr float kSteadyTime_s = 0.01F;    // in which the steady impulse follows the impulse
constexpr float kMaxBiasVelocity = 4.0F;  // of the push-out from penetration, u/s

SubstepParams make_substep_params(float h_s, float hertz, int substeps) {
  const float omega = 2.0F * std::numbers::pi_v<float> * std::min(hertz, 0.25F / h_s);
  const float a = 2.0F * kDampingRatio + h_s * omega, b = h_s * omega * a, scale = 1.0F / (1.0F + b);
  const float length = h_s / kSofteningTime_s;
  return {.h_s = h_s,
          .inverse_h = 1.0F / h_s,
          .bias_rate = omega / a,
          .mass_scale = b * scale,
          .impulse_scale = scale,
          .steady_share = std::clamp(1.0F - length * length, 0.0F, kMaxSteadyShare),
          .steady_gain = h_s / (h_s + kSteadyTime_s),
          .max_bias_velocity = kMaxBiasVelocity,
          .substep_fraction = 1.0F / static_cast<float>(substeps)};
}

void store(float (&to)[3], const Vec3& from) { Eigen::Map<Vec3>{to} = from; }
// Velocity change by an acceleration in a substep. The angular part is −0, which is neutral in floating-point
// addition.
BodyVelocity velocity_change(const Vec3& acceleration, float h_s) {
  BodyVelocity m;
  store(m.velocity, h_s * acceleration);
  store(m.angular_velocity, Vec3::Constant(-0.0F));
  return m;
}

}  // namespace

Solver& Solver::of_this_thread(const StepSettings& settings) {
  thread_local Solver solver(settings);
  if (!(solver.settings_ == settings)) solver.set_up(settings);
  return solver;
}

void Solver::set_up(const StepSettings& settings) {
  settings_ = settings;
  h_s_ = settings.dt_s / static_cast<float>(settings.substeps);
  pair_params_ = make_substep_params(h_s_, kPairContactHertz, settings.substeps);
  static_params_ = make_substep_params(h_s_, kStaticContactHertz, settings.substeps);
  // Adding 0 turns −0 into +0, as the sum with a zero wrench in external_velocity_change() does.
  gravity_change_ = velocity_change(settings.gravity + Vec3::Zero(), h_s_);
}

void Solver::step(BodyStore& bodies, const Input& input, const Member& member) {
  const IndexRange own_slabs = input.partition.share(member);
  const ConstraintGraph::Input contacts{.bodies = bodies,
                                        .pair_contacts = input.pair_contacts,
                                        .static_contacts = input.static_contacts,
                                        .pair_ranges = input.pair_ranges,
                                        .static_ranges = input.static_ranges};
  graph_.build(contacts, own_slabs, member);
  member.single([&] {
    graph_.pack_batches(contacts);
    has_supports_ =
        std::ranges::any_of(input.supports, [](const SupportPatches& s) { return !s.patches.empty(); });
    resize_buffers(input.partition, member.member_count, !input.cell_limits.empty());
    if (!input.joints.empty()) input.joints.begin_step(bodies, input.partition, settings_.substeps);
  });
  const bool any_restitution = settings_.field_material.restitution > 0.0F || bodies.restituting > 0;
  StepContext context{.bodies = bodies,
                      .input = input,
                      .partition = input.partition,
                      .own_slabs = own_slabs,
                      .own_rows = input.partition.rows_of(own_slabs),
                      .solver_bodies = solver_bodies(),
                      .pair_params = pair_params_,
                      .static_params = static_params_,
                      .kernels = contact_kernels(),
                      .any_restitution = any_restitution,
                      .all_spheres = bodies.non_spheres == 0,
                      .gravity_change = gravity_change_,
                      .active_rows = find_active_rows(input.partition, own_slabs, member.index),
                      .jammed_bodies = jammed_bodies_[member.index],
                      .supports = supports_[member.index]};
  context.jammed_bodies.clear();
  run_stages(context, member);
}

void Solver::resize_buffers(const SpatialPartition& partition, int member_count, bool has_cell_limits) {
  const auto grow = [](auto& buffer, int size) {
    if (std::ssize(buffer) < size) buffer.resize(size);
  };
  const int rows = partition.row_count(), points = graph_.point_count();
  grow(velocity_, rows), grow(delta_pose_, rows), grow(inverse_inertia_, rows);
  if (has_supports_) grow(support_of_row_, rows);
  grow(start_velocity_, rows), grow(material_, rows);
  grow(point_, points), grow(detail_, points);
  if (has_cell_limits) grow(limit_, points);
  shared_batches_.resize(partition.row_count(), member_count);
  impacts_.reset(member_count);
  heavy_islands_.reset(member_count, rows, graph_.batch_count());
  jammed_bodies_.resize(member_count);
  active_rows_.resize(member_count);
  supports_.resize(member_count);
}

// Barrier protocol: every run_contact_stage() waits before a colour's shared batches and arrives after them,
// so that a member's own batches overlap with the wait. Calls outside keep arrive() and wait() balanced.
void Solver::run_stages(StepContext& context, const Member& member) {
  load_bodies(context);
  if (graph_.point_count() == 0 && !context.has_joint_or_tip_stage() && !context.input.has_wrenches)
    return run_free(context, member);
  prepare_step(context, member);
  for (int substep = 0; substep < settings_.substeps; ++substep) run_substep(context, member, substep);
  finish_step(context, member);
}

// Up to the warm start of the first substep.
void Solver::prepare_step(StepContext& context, const Member& member) {
  const HeavyIslandSolver::Step heavy_step{.graph = graph_,
                                           .bodies = context.bodies,
                                           .partition = context.partition,
                                           .points = batch_points(),
                                           .velocity = velocity_.data(),
                                           .supports = context.input.supports,
                                           .joints = context.input.joints,
                                           .gravity = settings_.gravity,
                                           .h_s = h_s_};
  if (member.member_count > 1) shared_batches_.clear_marks(context.own_rows);
  member.arrive_and_wait();
  for_each_own_batch(context, member, [&](ContactKind kind, int batch) {
    prepare_batch(context, kind, batch);
    if (context.may_impact(kind)) find_impact_candidates(context, kind, batch, member);
    if (!context.all_spheres)
      heavy_islands_.find_heavy_lanes(heavy_step, batch, kind,
                                      is_pair(kind) ? context.pair_params : context.static_params, member);
  });
  member.arrive_and_wait();
  if (member.member_count > 1) {
    shared_batches_.split_batches(graph_, member);
  } else {
    // A single member solves all batches in their order, whatever their colours: in few calls of the kernels.
    serial_batches_.clear();
    for (const BatchRange& next : graph_.own_batches(member)) serial_batches_.append(next);
  }
  if (has_supports_) {
    collect_supports(context, member);
    prepare_supports(context);
  }
  if (heavy_islands_.any_heavy_lane()) heavy_islands_.build(heavy_step, context.own_rows, member);
  integrate_velocities(context, true);
  if (context.input.has_surface_spin) {
    member.arrive_and_wait();
    update_spinning_surface_velocities(context, member, 0.5F * h_s_);
  }
  member.arrive();
  JointSolver& joints = context.input.joints;
  run_joint_and_tip_stage(
      context, member,
      [&](IndexRange trees) { joints.begin_trees(context.bodies, context.partition, joint_rows(), trees); },
      [&](auto& points, auto... share) { points.begin_step(point_step(context), share...); });
  if (!joints.empty())
    member.on_caller([&] {
      jointed_contacts_.collect({.graph = graph_,
                                 .bodies = context.bodies,
                                 .partition = context.partition,
                                 .points = batch_points(),
                                 .rows = velocity_.data(),
                                 .joints = joints,
                                 .supports = std::span(supports_).first(has_supports_ ? supports_.size() : 0),
                                 .solved_rows = heavy_islands_.solved_rows()});
    });
  run_contact_stage(context, member, context.kernels.warm_start, 0.0F, SupportStage::kWarmStart);
}

void Solver::run_substep(StepContext& context, const Member& member, int substep) {
  JointSolver& joints = context.input.joints;
  const bool is_first = substep == 0, has_joint_or_tip_stage = context.has_joint_or_tip_stage();
  // The stages of joints and tips use the rows of all members, which their own batches of the warm start have
  // written.
  if (!is_first || has_joint_or_tip_stage) {
    member.wait();
    if (!is_first && context.input.has_surface_spin) {
      update_spinning_surface_velocities(context, member, h_s_);
      member.arrive_and_wait();
    }
    if (!is_first) integrate_velocities(context, false);
    member.arrive();
  }
  if (!is_first && !joints.empty())
    member.on_caller([&] { jointed_contacts_.keep_loads(batch_points(), context.solver_bodies); });
  if (has_joint_or_tip_stage)
    run_joint_and_tip_stage(
        context, member,
        [&](IndexRange trees) {
          joints.solve(context.bodies, joint_rows(), {h_s_, settings_.gravity}, trees);
        },
        [&](auto& points, auto... share) { points.solve(point_step(context), share...); });
  run_contact_stage(context, member, context.kernels.solve, static_cast<float>(substep) * h_s_,
                    SupportStage::kSolve);
  if (!joints.empty()) settle_jointed_contacts(context, member, true);
  member.wait();
  integrate_positions(context);
  member.arrive();
  if (has_joint_or_tip_stage)
    run_joint_and_tip_stage(
        context, member, [&](IndexRange trees) { joints.relax(joint_rows(), trees); },
        [&](auto& points, auto... share) { points.relax(point_step(context), share...); });
  run_contact_stage(context, member, context.kernels.relax, 0.0F, SupportStage::kRelax);
  if (!joints.empty()) settle_jointed_contacts(context, member, false);
}

void Solver::finish_step(StepContext& context, const Member& member) {
  const bool has_joints = !context.input.joints.empty();
  // Support patches, heavy islands and jointed bodies change impulses in batches of other members.
  if (has_supports_ || !heavy_islands_.empty() || has_joints) member.wait();
  if (has_joints) {
    if (member.is_caller()) jointed_contacts_.end_step(batch_points());
    member.arrive_and_wait();
  }
  for_each_own_batch(context, member,
                     [&](ContactKind kind, int batch) { store_impulses(context, kind, batch); });
  if (context.may_impact())
    solve_impacts(context, member);
  else
    member.arrive_and_wait();
  if (has_supports_) store_supports(context);
}

// Nothing touches: bodies that are alone in a small world fly in many of its steps.
void Solver::run_free(StepContext& context, const Member& member) {
  for (const IndexRange& rows : context.active_rows)
    context.kernels.integrate_free(rows.begin, rows.end, settings_.substeps, context.static_params.h_s,
                                   context.gravity_change, velocity_.data(), delta_pose_.data());
  member.arrive_and_wait();
}

template <class Each>
void Solver::for_each_own_batch(StepContext& context, const Member& member, Each each) {
  for (const BatchRange& run : graph_.own_batches(member))
    for (int i = run.first; i < run.first + run.count; ++i) {
      prefetch_contacts(context, run.kind, i + 1);
      each(run.kind, i);
    }
}

// ---- bodies, each member those of its slabs

std::span<const IndexRange> Solver::find_active_rows(const SpatialPartition& partition, IndexRange slabs,
                                                     int member) {
  std::vector<IndexRange>& found = active_rows_[member];
  found.clear();
  for (int s = slabs.begin; s < slabs.end; ++s)
    if (const IndexRange rows = partition.active_rows_of(s); rows.begin < rows.end) found.push_back(rows);
  return found;
}

void Solver::load_bodies(StepContext& context) {
  constexpr int kPrefetchDistance = 8;  // in rows: about one memory latency
  const BodyStore& b = context.bodies;
  for (int s = context.own_slabs.begin; s < context.own_slabs.end; ++s) {
    const IndexRange rows = context.partition.rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const std::size_t from = context.partition.body(row);
      if (row + kPrefetchDistance < rows.end) b.prefetch(context.partition.body(row + kPrefetchDistance));
      velocity_[row] = b.body_velocity[from];
      material_[row] = b.surface_material[from];
      if (!context.all_spheres) inverse_inertia_[row] = b.world_inverse_inertia[from];
      delta_pose_[row] = {};
    }
  }
  if (!has_supports_) return;
  std::fill(support_of_row_.begin() + context.own_rows.begin, support_of_row_.begin() + context.own_rows.end,
            SupportReference{});
  for (std::int32_t s = context.own_slabs.begin; s < context.own_slabs.end; ++s) {
    std::vector<SupportPatch>& patches = context.input.supports[s].patches;
    for (Index k = 0; k < std::ssize(patches); ++k) {
      patches[k].row = context.partition.row(patches[k].body);
      support_of_row_[patches[k].row] = {s, static_cast<std::int32_t>(k)};
    }
  }
}

// Velocity change by gravity and the body's wrench in a substep.
BodyVelocity Solver::external_velocity_change(const StepContext& context, int row) const {
  const std::size_t body = context.partition.body(row);
  const surface::Wrench& w = context.bodies.wrench[body];
  const float h_s = context.static_params.h_s;
  BodyVelocity change = velocity_change(settings_.gravity + velocity_[row].inverse_mass * w.force, h_s);
  if (!w.torque.isZero(0.0F)) {
    const InverseInertia& q = context.bodies.world_inverse_inertia[body];
    store(change.angular_velocity,
          h_s * Vec3(Vec3(q.xx, q.xy, q.xz).dot(w.torque), Vec3(q.xy, q.yy, q.yz).dot(w.torque),
                     Vec3(q.xz, q.yz, q.zz).dot(w.torque)));
  }
  return change;
}

// Also warm-starts all substeps but the first: normals and anchors are constant during the step, so
// re-applying the accumulated impulses equals repeating the velocity change that contacts caused in the last
// substep.
void Solver::integrate_velocities(StepContext& context, bool first) {
  const auto integrate = [&](int begin, int end, const BodyVelocity& change) {
    context.kernels.integrate_velocities(begin, end, change, first, velocity_.data(), start_velocity_.data());
  };
  for (const IndexRange& rows : context.active_rows) {
    if (!context.input.has_wrenches) {
      integrate(rows.begin, rows.end, context.gravity_change);
      continue;
    }
    for (int row = rows.begin; row < rows.end; ++row)
      integrate(row, row + 1, external_velocity_change(context, row));
  }
}

// The surface of a spinning cell has another velocity wherever a body is: that of the middle of each
// substep is taken (the midpoint rule), as the body moves for another `time_s`. All of a body's points move
// with its centre, because anchors keep the orientation that they had at the start of the step. Reads rows of
// other members: nobody may write them meanwhile.
void Solver::update_spinning_surface_velocities(StepContext& context, const Member& member, float time_s) {
  const auto turned = [&](int row, float spin) {
    const float(&v)[3] = velocity_[row].velocity;
    return Vec3(time_s * spin * Vec3(-v[1], v[0], 0.0F));
  };
  for (const BatchRange& run : graph_.own_batches(member)) {
    if (is_pair(run.kind)) continue;
    for (int i = run.first; i < run.first + run.count; ++i) {
      const ContactBatch& o = graph_.batch(i);
      if (!o.has_surface_spin) continue;
      for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
        for (int lane = 0; lane < o.lane_count; ++lane) {
          BatchPointDetail& d = detail_[k];
          if (d.surface_spin[lane] == 0.0F) continue;
          const Vec3 normal = load_lane(point_[k].normal, lane),
                     change = turned(o.a[lane], d.surface_spin[lane]);
          const Vec3 along = change - normal * normal.dot(change);
          for (int axis = 0; axis < 3; ++axis) d.surface_velocity[axis][lane] += along[axis];
        }
    }
  }
  if (!has_supports_) return;
  for_each_own_support(context, [&](SupportPatches& list, SupportPatch& p, std::span<Contact>) {
    if (!p.turns) return;
    for (Index i = p.first; i < p.first + p.count; ++i) {
      const Vec3 change = turned(p.row, list.samples.spin[i]);
      list.samples.velocity_x[i] += change.x(), list.samples.velocity_y[i] += change.y();
    }
  });
}

void Solver::integrate_positions(StepContext& context) {
  for (const IndexRange& rows : context.active_rows)
    context.kernels.integrate_positions(rows.begin, rows.end, context.static_params.h_s, velocity_.data(),
                                        delta_pose_.data());
}

void Solver::store_body(BodyStore& bodies, const SpatialPartition& partition, int row) const {
  const std::size_t to = partition.body(row);
  bodies.body_velocity[to] = velocity_[row];
  bodies.delta_pose[to] = delta_pose_[row];
}

// ---- one stage over all contacts: pairs colour by colour; static contacts last, as they must hold exactly

void Solver::run_contact_stage(StepContext& context, const Member& member,
                               const ContactKernel (&kernel)[kContactKindCount], float elapsed_s,
                               SupportStage support_stage) {
  SubstepParams &pair_params = context.pair_params, &static_params = context.static_params;
  pair_params.elapsed_s = static_params.elapsed_s = elapsed_s;
  const BatchPoints points = batch_points();
  const auto run = [&](std::span<const BatchRange> ranges) {
    for (const BatchRange& batches : ranges)
      kernel[batches.kind](graph_.batches_from(batches.first), batches.count, points, context.solver_bodies,
                           is_pair(batches.kind) ? pair_params : static_params);
  };
  if (member.member_count == 1) {
    run(serial_batches_.ranges);
    if (!has_supports_ && heavy_islands_.empty()) return;
  } else {
    for (int i = 0; i <= graph_.colour_count(); ++i) {
      // Own batches touch no row of another member's contacts, but the stage before may have changed any row.
      const auto shared = shared_batches_.shared(member, i);
      if (i == 0 || !shared.empty()) member.wait();
      run(shared);
      member.arrive();
      run(shared_batches_.own(member, i));
    }
  }
  if (has_supports_) run_supports(context, member, support_stage);
  if (support_stage == SupportStage::kWarmStart || heavy_islands_.empty()) return;
  member.wait();
  if (member.is_caller()) heavy_islands_.begin_solve();
  member.arrive_and_wait();
  heavy_islands_.solve(batch_points(), context.solver_bodies,
                       {pair_params, static_params, support_stage == SupportStage::kSolve,
                        context.input.joints, start_velocity_.data()},
                       member);
  member.arrive();
}

void Solver::run_supports(StepContext& context, const Member& member, SupportStage support_stage) {
  const SubstepParams& static_params = context.static_params;
  member.wait();
  const bool is_soft = support_stage == SupportStage::kSolve;
  const auto solve_points_of = [&](SupportPatches& list, SupportPatch& p) {
    const std::int32_t row = p.row;
    if (p.is_elastic)
      solve_springs(list, p, static_params, is_soft, velocity_[row], delta_pose_[row], inverse_inertia_[row]);
    else
      solve_support_points(list, p, batch_points(), static_params, is_soft, velocity_[row], delta_pose_[row],
                           inverse_inertia_[row]);
  };
  for (SupportBatch& batch : context.supports) {
    if (support_stage == SupportStage::kWarmStart) {
      batch.for_each([&](SupportPatches&, SupportPatch& p, int) {
        if (p.is_elastic) warm_start_springs(p, velocity_[p.row], inverse_inertia_[p.row]);
        warm_start_support(p, velocity_[p.row], inverse_inertia_[p.row]);
      });
      continue;
    }
    if (!batch.any_alone && !batch.any_wrench_alone) {
      solve_points_and_friction(batch, batch_points(), static_params, is_soft, velocity_.data(),
                                delta_pose_.data(), inverse_inertia_.data());
      continue;
    }
    const auto solve_points = [&] {
      if (batch.any_in_lanes)
        support_kernels().solve_points(batch.lanes, batch_points(), static_params, is_soft, velocity_.data(),
                                       delta_pose_.data(), inverse_inertia_.data());
      if (!batch.any_alone) return;
      batch.for_each([&](SupportPatches& list, SupportPatch& p, int lane) {
        if (batch.lanes.points[lane] == 0) solve_points_of(list, p);
      });
    };
    solve_points();
    solve_supports(batch, kAllLanes, batch_points(), is_soft, velocity_.data(), inverse_inertia_.data());
    // Friction tilts the body: again, because the normal constraints must hold at the end of the step.
    if (!is_soft) solve_points();
    if (!batch.any_alone) continue;
    batch.for_each([&](SupportPatches& list, SupportPatch& p, int) {
      if (!is_soft) share_loads(list, p, batch_points());
      if (p.is_elastic) end_spring_stage(list, p, is_soft, velocity_[p.row]);
    });
  }
  member.arrive();
}

// These move bodies of any member: joints, each member some of their trees; then contacts with yielding tips,
// each member some of their islands; then, on the caller alone, contacts with an elastic skin.
template <class OnJoints, class OnPoints>
void Solver::run_joint_and_tip_stage(const StepContext& context, const Member& member, OnJoints on_joints,
                                     OnPoints on_points) {
  JointSolver& joints = context.input.joints;
  TipSolver& tips = context.input.tips;
  SkinSolver& skin = context.input.skin;
  const auto run = [&](bool applies, auto work) {
    if (!applies) return;
    member.wait();
    work();
    member.arrive();
  };
  run(!joints.empty(), [&] { on_joints(joints.share(member)); });
  run(!tips.empty(), [&] { on_points(tips, tips.share(member)); });
  if (!skin.empty()) member.on_caller([&] { on_points(skin); });
}

PointStep Solver::point_step(const StepContext& context) {
  return {.bodies = context.bodies,
          .partition = context.partition,
          .static_contacts = context.input.static_contacts,
          .field_material = settings_.field_material,
          .params = context.static_params,
          .velocity = velocity_.data(),
          .delta_pose = delta_pose_.data(),
          .material = material_.data()};
}

void Solver::settle_jointed_contacts(StepContext& context, const Member& member, bool is_soft) {
  member.wait();
  if (jointed_contacts_.empty()) return member.arrive();
  if (member.is_caller()) jointed_contacts_.begin_settle(member);
  member.arrive_and_wait();  // the last batches of a stage come after its last arrival
  jointed_contacts_.settle({.points = batch_points(),
                            .rows = context.solver_bodies,
                            .pair_params = context.pair_params,
                            .static_params = context.static_params,
                            .is_soft = is_soft,
                            .joints = context.input.joints,
                            .joint_rows = joint_rows()},
                           member);
  member.arrive();
}

// ---- support patches, each member those of its batches

template <class Each>
void Solver::for_each_own_support(const StepContext& context, Each each) {
  for (SupportBatch& batch : context.supports)
    batch.for_each(
        [&](SupportPatches& list, SupportPatch& p, int lane) { each(list, p, batch.contacts[lane]); });
}

void Solver::collect_supports(StepContext& context, const Member& member) {
  context.supports.clear();
  const auto add = [&](int index) {
    const ContactBatch& o = graph_.batch(index);
    SupportBatch& batch = context.supports.emplace_back();
    batch.lanes.first_point = o.first_point;
    batch.lanes.point_count = std::min(o.point_count, SupportLanes::kMaxPoints);
    batch.lanes.lane_count = o.lane_count;
    std::copy_n(o.a, kLanes, batch.lanes.row);
    for (int lane = 0; lane < o.lane_count; ++lane) {
      const SupportReference at = support_of_row_[o.a[lane]];
      if (at.slab < 0) continue;
      SupportPatches& list = context.input.supports[at.slab];
      SupportPatch& p = list.patches[at.patch];
      p.batch_point = o.first_point, p.lane = lane, p.has_impulse_limit = o.has_impulse_limit;
      batch.list[lane] = &list, batch.patch[lane] = &p;
      batch.contacts[lane] = context.input.static_contacts.contacts_of(
          context.input.static_contacts.manifolds[graph_.manifold(index, lane)]);
      // The other lanes depend on the number of threads.
      const bool is_alone =
          p.is_elastic || p.has_shares || std::ssize(batch.contacts[lane]) > SupportLanes::kMaxPoints;
      (is_alone ? batch.any_alone : batch.any_in_lanes) = true;
      if (is_alone) continue;
      const auto points = support::points_of(list, p);
      for (const std::int32_t k : points)
        batch.lanes.points[lane] |= std::uint32_t{1} << static_cast<unsigned>(k);
      if (std::is_sorted(points.begin(), points.end()))
        batch.friction.points[lane] = batch.lanes.points[lane];
      else
        batch.any_wrench_alone = true;
    }
    if (!batch.any_alone && !batch.any_in_lanes) context.supports.pop_back();
  };
  for (const BatchRange& run : graph_.own_batches(member))
    for (int i = run.first; run.kind == kGeneralStatic && i < run.first + run.count; ++i) add(i);
}

void Solver::prepare_supports(StepContext& context) {
  const float substep_fraction = context.static_params.substep_fraction;
  for (SupportBatch& batch : context.supports)
    batch.for_each([&](SupportPatches& list, SupportPatch& p, int lane) {
      const int row = p.row;
      prepare_support(batch, lane, velocity_[row], inverse_inertia_[row],
                      friction_of(material_[row], settings_.field_material), substep_fraction);
      if (p.is_elastic) prepare_springs(list, p, velocity_[row], substep_fraction);
    });
}

void Solver::store_supports(StepContext& context) {
  for_each_own_support(context, [&](SupportPatches& list, SupportPatch& p, std::span<Contact> contacts) {
    if (context.input.finds_loads || !finds_loads_when_asked(p)) store_loads(list, p, contacts);
    store_friction(list, p, contacts);
  });
}

}  // namespace smartsurf::world
