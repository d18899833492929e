// The phases of one time step.
#include <algorithm>
#include <array>
#include <span>

#include "smartsurf/world/NativeEngineImpl.h"
#include "smartsurf/world/field/ContinuousCollision.h"
#include "smartsurf/world/field/SkinContacts.h"

namespace smartsurf::world {

void NativeEngine::Impl::read_inputs() {
  const bool moves =
      scene_field.max_speed != 0.0F || scene_field.has_force_limit() || !scene_field.yielding.empty();
  field_changed |= moves || field_moved;
  field_moved = moves;
  if (!unit.is_one()) {
    unit.update_motion(scene_field, field_copy, pool);
    if (has_wrenches)
      for (surface::Wrench& w : bodies.wrench) w = unit.to_world(w);
  }
  if (has_wrenches && bodies.has_offsets)  // from about the origin to about the centre of mass
    for (std::size_t i = 0; i < bodies.wrench.size(); ++i)
      bodies.wrench[i].torque += bodies.origin_offset[i].cross(bodies.wrench[i].force);
  field.update_column_height();
  if (field.skin.is_elastic) elastic_skin.begin(field.skin);
}

void NativeEngine::Impl::apply_timed_forces() {
  for (TimedForce& p : timed_forces) {
    const auto i = static_cast<std::size_t>(bodies.find(p.id));
    has_wrenches = true;
    bodies.wrench[i].force += p.force;
    bodies.wrench[i].torque += Vec3(bodies.orientation[i] * p.local_point).cross(p.force);
    --p.steps_left;
  }
  std::erase_if(timed_forces, [](const TimedForce& p) { return p.steps_left == 0; });
}

void NativeEngine::Impl::collect_active_bodies() {
  active_bodies.clear();
  for (std::size_t i = 0; i < bodies.id.size(); ++i)
    if (!bodies.asleep[i] && !bodies.is_static(i)) active_bodies.push_back(static_cast<std::int32_t>(i));
}

void NativeEngine::Impl::finalize_bodies(const Member& member) {
  constexpr int kPrefetchDistance = 8;  // in rows: about one memory latency
  const SpatialPartition& partition = collision.partition();
  const IndexRange own_slabs = partition.share(member);
  std::array<BodyStore::Rotating, kLanes> rotating;  // non-spheres collected for one SIMD batch
  std::size_t count = 0;
  auto flush_rotations = [&] {
    const auto batch = std::span(rotating).first(count);
    if (count > 0) bodies.integrate_poses(batch);
    for (const BodyStore::Rotating& r : batch) sleep.update_sleep_timer(bodies, r.body);
    count = 0;
  };
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const IndexRange rows = partition.active_rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const std::size_t i = partition.body(row);
      if (row + kPrefetchDistance < rows.end) {
        const std::size_t ahead = partition.body(row + kPrefetchDistance);
        bodies.prefetch(ahead);
        bodies.prefetch_rotation(ahead);
      }
      solver->store_body(bodies, partition, row);
      if (bodies.is_sphere[i]) {
        bodies.integrate_pose(i);
        sleep.update_sleep_timer(bodies, i);
      } else {
        // A clipped body must end in the pose in which it was found to touch, one with joints in that where they hold.
        const bool is_clipped = clip_to_time_of_impact(collision, bodies, i);
        rotating[count++] = {i, is_clipped || bodies.is_jointed[i] ? 0.0F : settings.dt_s};
        if (count == rotating.size()) flush_rotations();
      }
    }
  }
  flush_rotations();
  for (const IndexRange& run : collision.static_ranges().of(own_slabs)) {
    sleep.reset_timers_on_moving_cells(bodies, static_contacts, run);
    record_cell_impulses(run);
  }
  for (int s = own_slabs.begin; s < own_slabs.end; ++s)
    sleep.reset_timers_on_moving_cells(bodies, collision.supports()[static_cast<std::size_t>(s)]);
}

// Cell impulses have an array of their own, because write_cell_impulses() reads all of them on one thread: the
// contacts stay in the caches of the members that own them.
void NativeEngine::Impl::record_cell_impulses(IndexRange manifolds) {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = static_contacts.manifolds[static_cast<std::size_t>(i)];
    for (auto k = static_cast<std::size_t>(m.first); k < static_cast<std::size_t>(m.first + m.count); ++k) {
      const Contact& c = static_contacts.contacts[k];
      cell_impulses[k] = {c.loads_cell() && c.total_normal_impulse != 0.0F ? c.feature_id : -1,
                          c.total_normal_impulse};
    }
  }
}

// Sleepers keep the impulses that they had when they fell asleep.
void NativeEngine::Impl::write_cell_impulses() {
  if (sleeper_impulse_version != sleep.change_count()) {
    sleeper_impulse_version = sleep.change_count();
    sleeper_impulse.resize(scene_field.impulse.size(), 0.0F);
    for (const std::int32_t cell : sleeper_cells)
      sleeper_impulse[static_cast<std::size_t>(cell)] = scene_field.impulse[static_cast<std::size_t>(cell)] =
          0.0F;
    sleeper_cells.clear();
    for (const Contact& c : sleep.static_contacts().contacts)
      if (c.loads_cell()) {
        sleeper_impulse[static_cast<std::size_t>(c.feature_id)] += unit.to_scene(c.total_normal_impulse);
        sleeper_cells.push_back(c.feature_id);
      }
    for (const Sleep::SupportLoad& l : sleep.support_loads()) {
      sleeper_impulse[static_cast<std::size_t>(l.cell)] += unit.to_scene(l.impulse);
      sleeper_cells.push_back(l.cell);
    }
    for (const std::int32_t cell : sleeper_cells)
      scene_field.impulse[static_cast<std::size_t>(cell)] = sleeper_impulse[static_cast<std::size_t>(cell)];
    // Bodies that fell asleep in this step count as sleepers.
    for (const Manifold& m : static_contacts.manifolds)
      for (int k = m.first; bodies.asleep[static_cast<std::size_t>(m.a)] && k < m.first + m.count; ++k)
        cell_impulses[static_cast<std::size_t>(k)].cell = -1;
  }
  auto sleeper_impulse_on = [this](std::int32_t cell) {
    return sleeper_impulse.empty() ? 0.0F : sleeper_impulse[static_cast<std::size_t>(cell)];
  };
  for (const std::int32_t cell : loaded_cells)
    scene_field.impulse[static_cast<std::size_t>(cell)] = sleeper_impulse_on(cell);
  loaded_cells.clear();
  auto add_load = [this](std::int32_t cell, float impulse) {
    scene_field.impulse[static_cast<std::size_t>(cell)] += unit.to_scene(impulse);
    loaded_cells.push_back(cell);
  };
  for (const Load& entry : cell_impulses)
    if (entry.cell >= 0) add_load(entry.cell, entry.impulse);
  for (const SupportPatches& list : collision.supports())
    for (const SupportPatch& p : list.patches) {
      if (bodies.asleep[static_cast<std::size_t>(p.body)]) continue;  // a sleeper since this step
      for (auto i = static_cast<std::size_t>(p.first); i < static_cast<std::size_t>(p.first + p.count); ++i)
        if (list.samples.load[i] > 0.0F) add_load(list.samples.cell[i], list.samples.load[i]);
    }
}

// The friction of a step is taken as that of its last substep.
void NativeEngine::Impl::write_tip_impulses() {
  if (!field.has_offset() || field.has_skin()) return;
  std::vector<Vec3>& impulse = scene_field.tip_impulse;
  for (const std::int32_t cell : loaded_tips) impulse[static_cast<std::size_t>(cell)].setZero();
  loaded_tips.clear();
  const auto substeps = static_cast<float>(settings.substeps);
  const auto add_loads = [&](const ContactList& list, bool of_sleepers) {
    for (const Manifold& m : list.manifolds) {
      if ((bodies.asleep[static_cast<std::size_t>(m.a)] != 0) != of_sleepers) continue;
      for (int k = m.first; k < m.first + m.count; ++k) {
        const Contact& c = list.contacts[static_cast<std::size_t>(k)];
        if (c.total_normal_impulse == 0.0F || !c.loads_cell()) continue;
        const auto cell = static_cast<std::size_t>(c.feature_id);
        if (field.is_column(cell) || !field.tip_at(cell).moves_sideways()) continue;
        impulse[cell] -=
            unit.to_scene(Vec3(c.total_normal_impulse * c.normal + substeps * c.friction_impulse));
        loaded_tips.push_back(c.feature_id);
      }
    }
  };
  add_loads(static_contacts, false);
  add_loads(sleep.static_contacts(), true);
}

void NativeEngine::Impl::locate_skin_contacts() {
  skin_points.clear();
  for (const Manifold& m : static_contacts.manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts.contacts[static_cast<std::size_t>(k)];
      if (!c.touches_skin()) continue;
      const Vec3 point = bodies.position[static_cast<std::size_t>(m.a)] + c.anchor;
      skin_points.push_back({k, m.a, field.skin.locate(point.x(), point.y())});
    }
}

// The friction of a step is taken as in write_tip_impulses().
void NativeEngine::Impl::write_skin_impulses() {
  if (!field.has_skin()) return;
  std::vector<float>& impulse = scene_field.skin.impulse;
  std::ranges::fill(impulse, 0.0F);
  const auto substeps = static_cast<float>(settings.substeps);
  const auto add_load = [&](const surface::Skin::Location& at, const Contact& c) {
    const float load = c.total_normal_impulse * c.normal.z() + substeps * c.friction_impulse.z();
    for (int i = 0; i < 3; ++i) impulse[at.node[i]] += unit.to_scene(at.weight[i] * load);
  };
  for (const SkinPoint& p : skin_points)
    if (bodies.asleep[static_cast<std::size_t>(p.body)] == 0)
      add_load(p.at, static_contacts.contacts[static_cast<std::size_t>(p.contact)]);
  for (const Manifold& m : sleep.static_contacts().manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = sleep.static_contacts().contacts[static_cast<std::size_t>(k)];
      if (!c.touches_skin()) continue;
      const Vec3 point = bodies.position[static_cast<std::size_t>(m.a)] + c.anchor;
      add_load(field.skin.locate(point.x(), point.y()), c);
    }
}

void NativeEngine::Impl::wake_disturbed() {
  if (!sleep.any_asleep()) return;
  if (has_wrenches) sleep.wake_forced(bodies);
  sleep.wake_on_moving_cells(bodies);
}

void NativeEngine::Impl::find_sleepers_near_fast_bodies() {
  for (const std::int32_t i : active_bodies)
    if (Sleep::is_fast(bodies, static_cast<std::size_t>(i)))
      collision.for_each_nearby(bodies, static_cast<std::size_t>(i), [this](std::size_t j) {
        if (bodies.asleep[j]) hit_sleepers.push_back(static_cast<std::int32_t>(j));
      });
}

void NativeEngine::Impl::find_fast_bodies_near_sleepers() {
  for (std::size_t j = 0; j < bodies.asleep.size(); ++j) {
    if (!bodies.asleep[j]) continue;
    bool hit = false;
    collision.for_each_nearby(bodies, j,
                              [&](std::size_t i) { hit |= !bodies.asleep[i] && Sleep::is_fast(bodies, i); });
    if (hit) hit_sleepers.push_back(static_cast<std::int32_t>(j));
  }
}

// Wakes sleepers within reach of a fast body, so that the collision moves them. Queries from the smaller of the
// two sets.
void NativeEngine::Impl::wake_hit_sleepers() {
  if (!sleep.any_asleep()) return;
  hit_sleepers.clear();
  if (static_cast<std::size_t>(sleep.sleeping_count()) < active_bodies.size())
    find_fast_bodies_near_sleepers();
  else
    find_sleepers_near_fast_bodies();
  for (const std::int32_t i : hit_sleepers) sleep.wake_island(bodies, static_cast<std::size_t>(i));
  if (!hit_sleepers.empty()) collect_active_bodies();
}

void NativeEngine::Impl::step_active_bodies(const Member& member) {
  collision.update_broadphase(bodies, member);
  member.single([this] {
    wake_hit_sleepers();
    sleep.restore_contacts(bodies, pair_contacts, static_contacts);
  });
  const bool found = collision.find_contacts(bodies, pair_contacts, static_contacts, member);
  if (member.is_caller()) overloaded = !found;
  if (!found) return;
  if (member.is_caller()) cell_impulses.resize(static_contacts.contacts.size());
  if (field.has_force_limit())
    member.single(
        [this] { force_limits.distribute_limits(field, settings.dt_s, settings.substeps, static_contacts); });
  if (!field.yielding.empty()) member.single([this] { tips.collect(field, static_contacts); });
  if (field.has_skin())
    member.single([this] {
      locate_skin_contacts();
      if (field.skin.is_elastic) elastic_skin.collect(field.skin, bodies, static_contacts);
    });
  solver->step(bodies,
               {collision.partition(), pair_contacts, static_contacts, collision.pair_ranges(),
                collision.static_ranges(), collision.supports(), force_limits.limits(), has_wrenches, joints,
                tips, elastic_skin, jam_relief.min_depth()},
               member);
  finalize_bodies(member);
}

void NativeEngine::Impl::step() {
  solver = &Solver::of_this_thread(settings);
  lowered_speeds = field.has_force_limit();
  read_inputs();
  lowered_speeds |= jam_relief.hold_cells(field);
  apply_timed_forces();
  wake_disturbed();
  collect_active_bodies();
  if (active_bodies.empty()) {
    pair_contacts.clear();
    static_contacts.clear();
    cell_impulses.clear();
    tips.clear();
    skin_points.clear();
    collision.clear_supports();
  } else {
    team.run(active_bodies.size() >= kMinParallelBodies,
             [this](const Member& member) { step_active_bodies(member); });
    if (overloaded) return;
    tips.store(field, static_contacts, settings.dt_s);
    elastic_skin.store(static_contacts);
    if (!unit.is_one())
      for (const std::int32_t cell : tips.cells())
        unit.return_yielding_tip(field, static_cast<std::size_t>(cell), scene_field);
    force_limits.yield_overloaded_cells(bodies, static_contacts, settings.dt_s, field);
    // Of all members at once: a body may be in the lists of several, which depends on the number of threads.
    deep_bodies.clear();
    for (const std::vector<DeepContact>& deep : solver->deep_contacts())
      deep_bodies.insert(deep_bodies.end(), deep.begin(), deep.end());
    lowered_speeds |=
        jam_relief.stall_cells(deep_bodies, static_contacts, collision.supports(), bodies, field);
    strained_bodies.clear();
    joints.find_strained(bodies, jam_relief.min_depth(), strained_bodies);
    if (!strained_bodies.empty()) {
      jam_relief.spread(strained_bodies, pair_contacts, bodies);
      lowered_speeds |=
          jam_relief.stall_cells(strained_bodies, static_contacts, collision.supports(), bodies, field);
    }
    sleep.update_sleeping_set(bodies, active_bodies, pair_contacts, static_contacts, collision.supports());
  }
  if (field.skin.is_elastic) {
    elastic_skin.advance(field.skin);
    if (!unit.is_one()) unit.return_skin(field.skin, scene_field.skin);
  }
  write_cell_impulses();
  write_tip_impulses();
  write_skin_impulses();
  if (!unit.is_one() && lowered_speeds) unit.return_lowered_speeds(field_copy, scene_field);
  if (has_wrenches) std::fill(bodies.wrench.begin(), bodies.wrench.end(), surface::Wrench{});
  has_wrenches = false;
}

}  // namespace smartsurf::world
