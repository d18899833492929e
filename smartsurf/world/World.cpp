#include "smartsurf/world/World.h"
#include "common/threads/ThreadPool.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/CollisionPipeline.h"
#include "smartsurf/world/FieldHasher.h"
#include "smartsurf/world/Sleep.h"
#include "smartsurf/world/StateHash.h"
#include "smartsurf/world/field/CellForceLimits.h"
#include "smartsurf/world/field/ContinuousCollision.h"
#include "smartsurf/world/solver/Solver.h"

namespace smartsurf::world {
namespace {

constexpr std::size_t kMinParallelBodies = 512;  // fewer bodies are not worth the barriers

struct TimedForce {
  scene::ObjectId id;
  Vec3 force, local_point;  // local_point: where it acts, from the centre of mass, body axes, u
  long steps_left;
};

float ground_height(const scene::SceneSpec& s) {
  return s.world.ground ? static_cast<float>(s.surface.pin.min_height - s.surface.pin.length)
                        : -std::numeric_limits<float>::infinity();
}

StepSettings make_step_settings(const scene::SceneSpec& s) {
  const scene::Material& m = s.materials[static_cast<std::size_t>(s.surface.material)];
  StepSettings settings;
  settings.dt_s = static_cast<float>(s.world.dt_s);
  settings.substeps = std::max(1, (s.world.iterations + 1) / 2);
  settings.gravity = s.world.gravity.cast<float>();
  settings.field_friction_root = std::sqrt(static_cast<float>(m.friction));
  settings.field_rolling_friction_root = std::sqrt(static_cast<float>(m.rolling_friction));
  settings.field_restitution = static_cast<float>(m.restitution);
  return settings;
}

std::array<float, 3> to_array(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

template <std::size_t N>
std::span<const float> flatten(const std::vector<std::array<float, N>>& all) {
  return all.empty() ? std::span<const float>() : std::span(all.front().data(), N * all.size());
}

}  // namespace

struct World::Impl {
  Impl(const scene::SceneSpec& scene, surface::Field& cells, common::ThreadPool* pool)
      : materials(scene.materials),
        field(cells),
        settings(make_step_settings(scene)),
        team(pool),
        sleep(cells, settings.dt_s, settings.gravity),
        collision(cells, settings.dt_s, ground_height(scene)),
        solver(settings),
        field_hasher(pool) {
    field.impulse.assign(field.height.size(), 0.0F);
  }

  void apply_timed_forces();
  void collect_active_bodies();
  void wake_disturbed();
  void wake_hit_sleepers();
  void find_sleepers_near_fast_bodies();
  void find_fast_bodies_near_sleepers();
  void step_active_bodies(const Member&);
  void finalize_bodies(const Member&);
  void record_cell_impulses(IndexRange manifolds);
  void write_cell_impulses();

  std::vector<scene::Material> materials;
  surface::Field& field;
  StepSettings settings;
  Team team;
  BodyStore bodies;
  scene::ObjectId next_id = 0;
  std::vector<TimedForce> timed_forces;
  std::vector<std::int32_t> active_bodies;
  ContactList pair_contacts, static_contacts;
  Sleep sleep;
  CollisionPipeline collision;
  Solver solver;
  CellForceLimits force_limits;
  bool has_wrenches = false;  // since the last step
  struct Load {
    std::int32_t cell;  // −1: not a field contact, or no impulse
    float impulse;
  };
  std::vector<Load> cell_impulses;  // one per static contact
  // Cells on which active bodies had an impulse in the last step; impulse of the sleepers on each cell.
  std::vector<std::int32_t> loaded_cells;
  std::vector<float> sleeper_impulse;
  unsigned sleeper_impulse_version = 0;  // Sleep::change_count() that sleeper_impulse is for
  std::vector<std::int32_t> hit_sleepers;
  FieldHasher field_hasher;
  mutable std::vector<Vec3> velocity, angular_velocity;  // storage behind bodies()
};

std::string physics_version() { return SMARTSURF_VERSION; }

World::World(const scene::SceneSpec& scene, surface::Field& field, common::ThreadPool* pool)
    : impl_(std::make_unique<Impl>(scene, field, pool)) {
  for (const auto& object : scene.objects) add(object);
}

World::~World() = default;

scene::ObjectId World::add(const scene::ObjectSpec& spec) {
  Impl& s = *impl_;
  s.bodies.add(s.next_id, spec, s.materials[static_cast<std::size_t>(spec.material)]);
  s.collision.on_bodies_changed(s.bodies.size());
  s.sleep.wake_with_neighbours(s.bodies, s.bodies.id.size() - 1, s.pair_contacts, s.static_contacts);
  return s.next_id++;
}

bool World::alive(scene::ObjectId id) const { return impl_->bodies.find(id) >= 0; }

bool World::remove(scene::ObjectId id) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  impl_->sleep.wake_with_neighbours(impl_->bodies, static_cast<std::size_t>(index), impl_->pair_contacts,
                                    impl_->static_contacts);
  impl_->bodies.erase(static_cast<std::size_t>(index));
  remove_body(impl_->pair_contacts, index);
  remove_body(impl_->static_contacts, index);
  impl_->sleep.on_body_removed(index);
  impl_->collision.on_bodies_changed(impl_->bodies.size());
  std::erase_if(impl_->timed_forces, [id](const TimedForce& p) { return p.id == id; });
  return true;
}

bool World::place(scene::ObjectId id, const scene::ObjectStateUpdate& placement) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  impl_->sleep.wake_with_neighbours(impl_->bodies, static_cast<std::size_t>(index), impl_->pair_contacts,
                                    impl_->static_contacts);
  impl_->bodies.apply_placement(static_cast<std::size_t>(index), placement);
  return true;
}

bool World::apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                        const std::optional<Eigen::Vector3d>& point, double duration_s) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  const auto i = static_cast<std::size_t>(index);
  const long steps = std::max(1L, std::lround(duration_s / static_cast<double>(impl_->settings.dt_s)));
  const Quat& q = impl_->bodies.orientation[i];
  const Vec3 local_point =
      point ? Vec3(q.conjugate() * (point->cast<float>() - impl_->bodies.position[i])) : Vec3(0, 0, 0);
  impl_->timed_forces.push_back({id, force.cast<float>(), local_point, steps});
  return true;
}

scene::ObjectState World::state(scene::ObjectId id) const {
  const BodyStore& b = impl_->bodies;
  const auto i = static_cast<std::size_t>(b.find(id));
  return {b.position[i].cast<double>(), b.orientation[i].cast<double>(), b.velocity(i).cast<double>(),
          b.angular_velocity(i).cast<double>()};
}

surface::BodyView World::bodies() const {
  const Impl& s = *impl_;
  s.velocity.resize(s.bodies.id.size());
  s.angular_velocity.resize(s.bodies.id.size());
  for (std::size_t i = 0; i < s.velocity.size(); ++i) {
    s.velocity[i] = s.bodies.velocity(i);
    s.angular_velocity[i] = s.bodies.angular_velocity(i);
  }
  return {s.bodies.id, s.bodies.position,  s.bodies.orientation,
          s.velocity,  s.angular_velocity, s.bodies.mass};
}

std::span<surface::Wrench> World::wrenches() {
  impl_->has_wrenches = true;
  return impl_->bodies.wrench;
}

void World::Impl::apply_timed_forces() {
  for (TimedForce& p : timed_forces) {
    const auto i = static_cast<std::size_t>(bodies.find(p.id));
    has_wrenches = true;
    bodies.wrench[i].force += p.force;
    bodies.wrench[i].torque += Vec3(bodies.orientation[i] * p.local_point).cross(p.force);
    --p.steps_left;
  }
  std::erase_if(timed_forces, [](const TimedForce& p) { return p.steps_left == 0; });
}

void World::Impl::collect_active_bodies() {
  active_bodies.clear();
  for (std::size_t i = 0; i < bodies.id.size(); ++i)
    if (!bodies.is_static(i) && !bodies.asleep[i]) active_bodies.push_back(static_cast<std::int32_t>(i));
}

void World::Impl::finalize_bodies(const Member& member) {
  constexpr int kPrefetchDistance = 8;  // in rows: about one memory latency
  const SpatialPartition& partition = collision.partition();
  const IndexRange own_slabs = partition.share(member);
  std::array<std::size_t, kLanes> rotating;  // non-spheres collected for one SIMD batch
  std::size_t count = 0;
  auto flush_rotations = [&] {
    if (count > 0) bodies.integrate_gyroscopic(std::span(rotating).first(count), settings.dt_s);
    for (const std::size_t i : std::span(rotating).first(count)) sleep.update_sleep_timer(bodies, i);
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
      solver.store_body(bodies, partition, row);
      clip_to_time_of_impact(collision, bodies, i);
      bodies.integrate_pose(i);
      if (bodies.is_sphere[i]) {
        sleep.update_sleep_timer(bodies, i);
      } else {
        rotating[count++] = i;
        if (count == rotating.size()) flush_rotations();
      }
    }
  }
  flush_rotations();
  for (const IndexRange& run : collision.static_ranges().of(own_slabs)) {
    sleep.reset_timers_on_moving_cells(bodies, static_contacts, run);
    record_cell_impulses(run);
  }
}

// Cell impulses have an array of their own, because write_cell_impulses() reads all of them on one thread: the
// contacts stay in the caches of the members that own them.
void World::Impl::record_cell_impulses(IndexRange manifolds) {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = static_contacts.manifolds[static_cast<std::size_t>(i)];
    for (auto k = static_cast<std::size_t>(m.first); k < static_cast<std::size_t>(m.first + m.count); ++k) {
      const Contact& c = static_contacts.contacts[k];
      cell_impulses[k] = {c.other == kField && c.total_normal_impulse != 0.0F ? c.feature_id : -1,
                          c.total_normal_impulse};
    }
  }
}

// Sleepers keep the impulses that they had when they fell asleep.
void World::Impl::write_cell_impulses() {
  if (sleeper_impulse_version != sleep.change_count()) {
    sleeper_impulse_version = sleep.change_count();
    sleeper_impulse.assign(field.impulse.size(), 0.0F);
    for (const Contact& c : sleep.static_contacts().contacts)
      if (c.other == kField)
        sleeper_impulse[static_cast<std::size_t>(c.feature_id)] += c.total_normal_impulse;
    field.impulse = sleeper_impulse;
    loaded_cells.clear();
  }
  auto sleeper_impulse_on = [this](std::int32_t cell) {
    return sleeper_impulse.empty() ? 0.0F : sleeper_impulse[static_cast<std::size_t>(cell)];
  };
  for (const std::int32_t cell : loaded_cells)
    field.impulse[static_cast<std::size_t>(cell)] = sleeper_impulse_on(cell);
  loaded_cells.clear();
  for (const Load& entry : cell_impulses) {
    if (entry.cell < 0) continue;
    field.impulse[static_cast<std::size_t>(entry.cell)] += entry.impulse;
    loaded_cells.push_back(entry.cell);
  }
}

void World::Impl::wake_disturbed() {
  if (!sleep.any_asleep()) return;
  if (has_wrenches) sleep.wake_forced(bodies);
  sleep.wake_on_moving_cells(bodies);
}

void World::Impl::find_sleepers_near_fast_bodies() {
  for (const std::int32_t i : active_bodies)
    if (Sleep::is_fast(bodies, static_cast<std::size_t>(i)))
      collision.for_each_nearby(bodies, static_cast<std::size_t>(i), [this](std::size_t j) {
        if (bodies.asleep[j]) hit_sleepers.push_back(static_cast<std::int32_t>(j));
      });
}

void World::Impl::find_fast_bodies_near_sleepers() {
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
void World::Impl::wake_hit_sleepers() {
  if (!sleep.any_asleep()) return;
  hit_sleepers.clear();
  if (static_cast<std::size_t>(sleep.sleeping_count()) < active_bodies.size())
    find_fast_bodies_near_sleepers();
  else
    find_sleepers_near_fast_bodies();
  for (const std::int32_t i : hit_sleepers) sleep.wake_island(bodies, static_cast<std::size_t>(i));
  if (!hit_sleepers.empty()) collect_active_bodies();
}

void World::Impl::step_active_bodies(const Member& member) {
  collision.update_broadphase(bodies, member);
  member.single([this] {
    wake_hit_sleepers();
    sleep.restore_contacts(bodies, pair_contacts, static_contacts);
  });
  collision.find_contacts(bodies, pair_contacts, static_contacts, member);
  if (member.is_caller()) cell_impulses.resize(static_contacts.contacts.size());
  if (field.has_force_limit())
    member.single([this] { force_limits.distribute_limits(field, settings.dt_s, static_contacts); });
  solver.step(bodies,
              {collision.partition(), pair_contacts, static_contacts, collision.pair_ranges(),
               collision.static_ranges(), field.has_force_limit(), has_wrenches},
              member);
  finalize_bodies(member);
}

void World::step() {
  Impl& s = *impl_;
  s.apply_timed_forces();
  s.wake_disturbed();
  s.collect_active_bodies();
  if (s.active_bodies.empty()) {
    s.pair_contacts.clear();
    s.static_contacts.clear();
    s.cell_impulses.clear();
  } else {
    s.team.run(s.active_bodies.size() >= kMinParallelBodies,
               [&s](const Member& member) { s.step_active_bodies(member); });
    s.force_limits.yield_overloaded_cells(s.bodies, s.static_contacts, s.settings.dt_s, s.field);
    s.sleep.update_sleeping_set(s.bodies, s.active_bodies, s.pair_contacts, s.static_contacts);
  }
  s.write_cell_impulses();
  if (s.has_wrenches) std::fill(s.bodies.wrench.begin(), s.bodies.wrench.end(), surface::Wrench{});
  s.has_wrenches = false;
}

std::vector<ContactPoint> World::contacts() const {
  const Impl& s = *impl_;
  std::vector<ContactPoint> out;
  for (const ContactList* list :
       {&s.pair_contacts, &s.static_contacts, &s.sleep.pair_contacts(), &s.sleep.static_contacts()})
    for (const Manifold& m : list->manifolds)
      for (int k = m.first; k < m.first + m.count; ++k) {
        const Contact& c = list->contacts[static_cast<std::size_t>(k)];
        if (c.total_normal_impulse > 0.0F)
          out.push_back({s.bodies.position[static_cast<std::size_t>(m.a)] + c.anchor, c.normal,
                         c.total_normal_impulse});
      }
  return out;
}

int World::sleeping_count() const { return impl_->sleep.sleeping_count(); }

void World::snapshot(scene::Snapshot& out) const {
  const BodyStore& b = impl_->bodies;
  const std::size_t n = b.id.size();
  out.id = b.id;
  out.position.resize(n);
  out.orientation.resize(n);
  out.velocity.resize(n);
  out.angular_velocity.resize(n);
  // Each thread copies the bodies that it simulated, which are still in its cache.
  impl_->team.run(n >= kMinParallelBodies, [&](const Member& member) {
    for (const std::int32_t body : impl_->collision.own_bodies(member)) {
      const auto i = static_cast<std::size_t>(body);
      const Quat& q = b.orientation[i];
      out.position[i] = to_array(b.position[i]);
      out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
      out.velocity[i] = to_array(b.velocity(i));
      out.angular_velocity[i] = to_array(b.angular_velocity(i));
    }
  });
  StateHash hash;
  for (const scene::ObjectId id : out.id) hash.add(id);
  hash.add(flatten(out.position));
  hash.add(flatten(out.orientation));
  hash.add(flatten(out.velocity));
  hash.add(flatten(out.angular_velocity));
  impl_->field_hasher.copy_and_hash(impl_->field, out.height, hash);
  out.state_hash = hash.value();
  const Sleep& sleep = impl_->sleep;
  out.contact_count = static_cast<std::uint32_t>(
      impl_->pair_contacts.contacts.size() + impl_->static_contacts.contacts.size() +
      sleep.pair_contacts().contacts.size() + sleep.static_contacts().contacts.size());
}

std::optional<scene::ObjectId> World::first_non_finite() const {
  const BodyStore& b = impl_->bodies;
  for (std::size_t i = 0; i < b.id.size(); ++i)
    if (!b.position[i].allFinite() || !b.velocity(i).allFinite() || !b.angular_velocity(i).allFinite())
      return b.id[i];
  return std::nullopt;
}

}  // namespace smartsurf::world
