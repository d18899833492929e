#include "smartsurf/world/World.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/CellLimits.h"
#include "smartsurf/world/Detector.h"
#include "smartsurf/world/FieldCopy.h"
#include "smartsurf/world/FieldStop.h"
#include "smartsurf/world/Sleep.h"
#include "smartsurf/world/Solver.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::world {
namespace {

constexpr std::size_t kWorthSharing = 512;  // bodies

struct Push {
  scene::ObjectId id;
  Vec3 force, arm;  // arm: where it acts, in the body's own axes
  long steps_left;
};

float ground_height(const scene::SceneSpec& s) {
  return s.world.ground ? static_cast<float>(s.surface.pin.min_height - s.surface.pin.length)
                        : -std::numeric_limits<float>::infinity();
}

StepSettings settings_of(const scene::SceneSpec& s) {
  const scene::Material& m = s.materials[static_cast<std::size_t>(s.surface.material)];
  StepSettings settings;
  settings.dt_s = static_cast<float>(s.world.dt_s);
  settings.substeps = std::max(1, (s.world.iterations + 1) / 2);
  settings.gravity = s.world.gravity.cast<float>();
  settings.field_friction_root = std::sqrt(static_cast<float>(m.friction));
  settings.field_rolling_root = std::sqrt(static_cast<float>(m.rolling_friction));
  settings.field_restitution = static_cast<float>(m.restitution);
  return settings;
}

std::array<float, 3> array_of(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

template <std::size_t N>
std::span<const float> numbers_of(const std::vector<std::array<float, N>>& all) {
  return all.empty() ? std::span<const float>() : std::span(all.front().data(), N * all.size());
}

}  // namespace

struct World::State {
  State(const scene::SceneSpec& scene, surface::Field& cells, surface::WorkerPool* pool)
      : materials(scene.materials),
        field(cells),
        settings(settings_of(scene)),
        team(pool),
        sleep(cells, settings.dt_s, settings.gravity),
        detector(cells, settings.dt_s, ground_height(scene)),
        solver(settings),
        field_copy(pool) {
    field.impulse.assign(field.height.size(), 0.0F);
  }

  void apply_pushes();
  void list_moving();
  void wake();
  void wake_what_is_hit();
  void look_around_fast();
  void look_around_sleepers();
  void step_moving(const Member&);
  void move_bodies(const Member&);
  void note_loads(Range manifolds);
  void write_impulses();

  std::vector<scene::Material> materials;
  surface::Field& field;
  StepSettings settings;
  Team team;
  BodyStore bodies;
  scene::ObjectId next_id = 0;
  std::vector<Push> pushes;
  std::vector<std::int32_t> moving;
  ContactList pairs, world;
  Sleep sleep;
  Detector detector;
  Solver solver;
  CellLimits limits;
  bool wrenches_given = false;  // since the last step
  struct Load {
    std::int32_t cell;  // −1: none
    float impulse;
  };
  std::vector<Load> loads;  // one a contact with the world
  // Cells with an impulse of the last step, and what the sleepers press on each.
  std::vector<std::int32_t> pressed;
  std::vector<float> rest_impulse;
  unsigned rest_impulse_of = 0;  // Sleep::changes()
  std::vector<std::int32_t> near;
  FieldCopy field_copy;
  mutable std::vector<Vec3> velocity, spin;  // for bodies()
};

std::string physics_version() { return SMARTSURF_VERSION; }

World::World(const scene::SceneSpec& scene, surface::Field& field, surface::WorkerPool* pool)
    : state_(std::make_unique<State>(scene, field, pool)) {
  for (const auto& object : scene.objects) add(object);
}

World::~World() = default;

scene::ObjectId World::add(const scene::ObjectSpec& spec) {
  State& s = *state_;
  s.bodies.add(s.next_id, spec, s.materials[static_cast<std::size_t>(spec.material)]);
  s.detector.bodies_changed(s.bodies.size());
  s.sleep.disturb(s.bodies, s.bodies.id.size() - 1, s.pairs, s.world);
  return s.next_id++;
}

bool World::alive(scene::ObjectId id) const { return state_->bodies.find(id) >= 0; }

bool World::remove(scene::ObjectId id) {
  const int index = state_->bodies.find(id);
  if (index < 0) return false;
  state_->sleep.disturb(state_->bodies, static_cast<std::size_t>(index), state_->pairs, state_->world);
  state_->bodies.erase(static_cast<std::size_t>(index));
  forget(state_->pairs, index);
  forget(state_->world, index);
  state_->sleep.forget_body(index);
  state_->detector.bodies_changed(state_->bodies.size());
  std::erase_if(state_->pushes, [id](const Push& p) { return p.id == id; });
  return true;
}

bool World::place(scene::ObjectId id, const scene::Placement& placement) {
  const int index = state_->bodies.find(id);
  if (index < 0) return false;
  state_->sleep.disturb(state_->bodies, static_cast<std::size_t>(index), state_->pairs, state_->world);
  state_->bodies.place(static_cast<std::size_t>(index), placement);
  return true;
}

bool World::push(scene::ObjectId id, const Eigen::Vector3d& force,
                 const std::optional<Eigen::Vector3d>& point, double duration_s) {
  const int index = state_->bodies.find(id);
  if (index < 0) return false;
  const auto i = static_cast<std::size_t>(index);
  const long steps = std::max(1L, std::lround(duration_s / static_cast<double>(state_->settings.dt_s)));
  const Quat& q = state_->bodies.orientation[i];
  const Vec3 arm =
      point ? Vec3(q.conjugate() * (point->cast<float>() - state_->bodies.position[i])) : Vec3(0, 0, 0);
  state_->pushes.push_back({id, force.cast<float>(), arm, steps});
  return true;
}

scene::ObjectState World::state(scene::ObjectId id) const {
  const BodyStore& b = state_->bodies;
  const auto i = static_cast<std::size_t>(b.find(id));
  return {b.position[i].cast<double>(), b.orientation[i].cast<double>(), b.velocity(i).cast<double>(),
          b.spin(i).cast<double>()};
}

surface::Bodies World::bodies() const {
  const State& s = *state_;
  s.velocity.resize(s.bodies.id.size());
  s.spin.resize(s.bodies.id.size());
  for (std::size_t i = 0; i < s.velocity.size(); ++i) {
    s.velocity[i] = s.bodies.velocity(i);
    s.spin[i] = s.bodies.spin(i);
  }
  return {s.bodies.id, s.bodies.position, s.bodies.orientation, s.velocity, s.spin, s.bodies.mass};
}

std::span<surface::Wrench> World::wrenches() {
  state_->wrenches_given = true;
  return state_->bodies.wrench;
}

void World::State::apply_pushes() {
  for (Push& p : pushes) {
    const auto i = static_cast<std::size_t>(bodies.find(p.id));
    wrenches_given = true;
    bodies.wrench[i].force += p.force;
    bodies.wrench[i].torque += Vec3(bodies.orientation[i] * p.arm).cross(p.force);
    --p.steps_left;
  }
  std::erase_if(pushes, [](const Push& p) { return p.steps_left == 0; });
}

void World::State::list_moving() {
  moving.clear();
  for (std::size_t i = 0; i < bodies.id.size(); ++i)
    if (!bodies.fixed(i) && !bodies.asleep[i]) moving.push_back(static_cast<std::int32_t>(i));
}

void World::State::move_bodies(const Member& member) {
  constexpr int kAhead = 8;  // rows: about what a trip to memory takes
  const Slabs& slabs = detector.slabs();
  const Range mine = slabs.share(member);
  std::array<std::size_t, kLanes> turning;  // settled, and their axes to follow
  std::size_t count = 0;
  auto turn = [&] {
    if (count > 0) bodies.turn_freely(std::span(turning).first(count), settings.dt_s);
    for (const std::size_t i : std::span(turning).first(count)) sleep.time_rest(bodies, i);
    count = 0;
  };
  for (int s = mine.begin; s < mine.end; ++s) {
    const Range rows = slabs.moving_rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const std::size_t i = slabs.body(row);
      if (row + kAhead < rows.end) {
        const std::size_t ahead = slabs.body(row + kAhead);
        bodies.fetch(ahead);
        bodies.fetch_turning(ahead);
      }
      solver.hand_back(bodies, slabs, row);
      stop_at_field(detector, bodies, i);
      bodies.settle(i);
      if (bodies.round[i]) {
        sleep.time_rest(bodies, i);
      } else {
        turning[count++] = i;
        if (count == turning.size()) turn();
      }
    }
  }
  turn();
  for (const Range& run : detector.world_runs().of(mine)) {
    sleep.unsettle(bodies, world, run);
    note_loads(run);
  }
}

// Apart from the contacts, for one thread will read them all: contacts that it does not read need not travel
// to it and back.
void World::State::note_loads(Range manifolds) {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = world.manifolds[static_cast<std::size_t>(i)];
    for (auto k = static_cast<std::size_t>(m.first); k < static_cast<std::size_t>(m.first + m.count); ++k) {
      const Contact& c = world.contacts[k];
      loads[k] = {c.other == kField && c.total != 0.0F ? c.key : -1, c.total};
    }
  }
}

// Sleepers press on as they did when they fell asleep.
void World::State::write_impulses() {
  if (rest_impulse_of != sleep.changes()) {
    rest_impulse_of = sleep.changes();
    rest_impulse.assign(field.impulse.size(), 0.0F);
    for (const Contact& c : sleep.world().contacts)
      if (c.other == kField) rest_impulse[static_cast<std::size_t>(c.key)] += c.total;
    field.impulse = rest_impulse;
    pressed.clear();
  }
  auto rest = [this](std::int32_t cell) {
    return rest_impulse.empty() ? 0.0F : rest_impulse[static_cast<std::size_t>(cell)];
  };
  for (const std::int32_t cell : pressed) field.impulse[static_cast<std::size_t>(cell)] = rest(cell);
  pressed.clear();
  for (const Load& load : loads) {
    if (load.cell < 0) continue;
    field.impulse[static_cast<std::size_t>(load.cell)] += load.impulse;
    pressed.push_back(load.cell);
  }
}

void World::State::wake() {
  if (!sleep.any()) return;
  if (wrenches_given) sleep.wake_what_is_pushed(bodies);
  sleep.wake_on_moving_cells(bodies);
}

void World::State::look_around_fast() {
  for (const std::int32_t i : moving)
    if (Sleep::fast(bodies, static_cast<std::size_t>(i)))
      detector.for_near(bodies, static_cast<std::size_t>(i), [this](std::size_t j) {
        if (bodies.asleep[j]) near.push_back(static_cast<std::int32_t>(j));
      });
}

void World::State::look_around_sleepers() {
  for (std::size_t j = 0; j < bodies.asleep.size(); ++j) {
    if (!bodies.asleep[j]) continue;
    bool hit = false;
    detector.for_near(bodies, j, [&](std::size_t i) { hit |= !bodies.asleep[i] && Sleep::fast(bodies, i); });
    if (hit) near.push_back(static_cast<std::int32_t>(j));
  }
}

// What is about to hit a sleeper wakes it, so that the blow moves it.
void World::State::wake_what_is_hit() {
  if (!sleep.any()) return;
  near.clear();
  if (static_cast<std::size_t>(sleep.sleepers()) < moving.size())
    look_around_sleepers();
  else
    look_around_fast();
  for (const std::int32_t i : near) sleep.wake_connected(bodies, static_cast<std::size_t>(i));
  if (!near.empty()) list_moving();
}

void World::State::step_moving(const Member& member) {
  detector.arrange(bodies, member);
  member.alone([this] {
    wake_what_is_hit();
    sleep.return_contacts(bodies, pairs, world);
  });
  detector.detect(bodies, pairs, world, member);
  if (member.leads()) loads.resize(world.contacts.size());
  if (field.yields()) member.alone([this] { limits.share_out(field, settings.dt_s, world); });
  solver.step(bodies,
              {detector.slabs(), pairs, world, detector.pair_runs(), detector.world_runs(), field.yields(),
               wrenches_given},
              member);
  move_bodies(member);
}

void World::step() {
  State& s = *state_;
  s.apply_pushes();
  s.wake();
  s.list_moving();
  if (s.moving.empty()) {
    s.pairs.clear();
    s.world.clear();
    s.loads.clear();
  } else {
    s.team.run(s.moving.size() >= kWorthSharing, [&s](const Member& member) { s.step_moving(member); });
    s.limits.give_way(s.bodies, s.world, s.settings.dt_s, s.field);
    s.sleep.update(s.bodies, s.moving, s.pairs, s.world);
  }
  s.write_impulses();
  if (s.wrenches_given) std::fill(s.bodies.wrench.begin(), s.bodies.wrench.end(), surface::Wrench{});
  s.wrenches_given = false;
}

std::vector<ContactPoint> World::contacts() const {
  const State& s = *state_;
  std::vector<ContactPoint> out;
  for (const ContactList* list : {&s.pairs, &s.world, &s.sleep.pairs(), &s.sleep.world()})
    for (const Manifold& m : list->manifolds)
      for (int k = m.first; k < m.first + m.count; ++k) {
        const Contact& c = list->contacts[static_cast<std::size_t>(k)];
        if (c.total > 0.0F)
          out.push_back({s.bodies.position[static_cast<std::size_t>(m.a)] + c.arm, c.normal, c.total});
      }
  return out;
}

int World::asleep() const { return state_->sleep.sleepers(); }

void World::snapshot(scene::Snapshot& out) const {
  const BodyStore& b = state_->bodies;
  const std::size_t n = b.id.size();
  out.id = b.id;
  out.position.resize(n);
  out.orientation.resize(n);
  out.velocity.resize(n);
  out.angular_velocity.resize(n);
  // Each thread copies what it moved: if one did it all, the others' bodies would travel to it and back.
  state_->team.run(n >= kWorthSharing, [&](const Member& member) {
    for (const std::int32_t body : state_->detector.own_bodies(member)) {
      const auto i = static_cast<std::size_t>(body);
      const Quat& q = b.orientation[i];
      out.position[i] = array_of(b.position[i]);
      out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
      out.velocity[i] = array_of(b.velocity(i));
      out.angular_velocity[i] = array_of(b.spin(i));
    }
  });
  StateHash hash;
  for (const scene::ObjectId id : out.id) hash.add(id);
  hash.add(numbers_of(out.position));
  hash.add(numbers_of(out.orientation));
  hash.add(numbers_of(out.velocity));
  hash.add(numbers_of(out.angular_velocity));
  state_->field_copy.take(state_->field, out.height, hash);
  out.state_hash = hash.value();
  const Sleep& sleep = state_->sleep;
  out.contacts = static_cast<std::uint32_t>(state_->pairs.contacts.size() + state_->world.contacts.size() +
                                            sleep.pairs().contacts.size() + sleep.world().contacts.size());
}

std::optional<scene::ObjectId> World::first_not_finite() const {
  const BodyStore& b = state_->bodies;
  for (std::size_t i = 0; i < b.id.size(); ++i)
    if (!b.position[i].allFinite() || !b.velocity(i).allFinite() || !b.spin(i).allFinite()) return b.id[i];
  return std::nullopt;
}

}  // namespace smartsurf::world
