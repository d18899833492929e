#include "smartsurf/world/NativeEngine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "smartsurf/world/NativeEngineImpl.h"

namespace smartsurf::world {
namespace {

float ground_height(const scene::SceneSpec& s, const LengthUnit& unit) {
  return s.world.ground ? static_cast<float>(unit.to_world(s.surface.pin.min_height - s.surface.pin.length))
                        : -std::numeric_limits<float>::infinity();
}

StepSettings make_step_settings(const scene::SceneSpec& s, const LengthUnit& unit) {
  const scene::Material m = unit.to_world(s.materials[static_cast<std::size_t>(s.surface.material)]);
  StepSettings settings;
  settings.dt_s = static_cast<float>(s.world.dt_s);
  settings.substeps = std::max(1, (s.world.iterations + 1) / 2);
  settings.gravity = unit.to_world(s.world.gravity).cast<float>();
  settings.field_friction_root = std::sqrt(static_cast<float>(m.friction));
  settings.field_rolling_friction_root = std::sqrt(static_cast<float>(m.rolling_friction));
  settings.field_restitution = static_cast<float>(m.restitution);
  return settings;
}

std::array<float, 3> to_array(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

NativeEngine::Impl::Impl(const scene::SceneSpec& scene, surface::Field& cells,
                         common::ThreadPool* thread_pool)
    : unit(scene.surface.pitch),
      scene_materials(scene.materials),
      scene_field(cells),
      field_copy(unit.is_one() ? surface::Field() : unit.to_world(cells)),
      field(unit.is_one() ? cells : field_copy),
      settings(make_step_settings(scene, unit)),
      team(thread_pool),
      sleep(field, settings.dt_s, settings.gravity, scene.world.sleep),
      collision(field, settings.dt_s, ground_height(scene, unit)),
      elastic_skin(settings.dt_s, settings.gravity.z(), settings.substeps),
      jam_relief(settings.dt_s),
      pool(thread_pool),
      field_hasher(thread_pool) {
  for (const scene::Material& material : scene.materials) materials.push_back(unit.to_world(material));
  scene_field.impulse.assign(scene_field.height.size(), 0.0F);
}

NativeEngine::NativeEngine(const scene::SceneSpec& scene, surface::Field& field, common::ThreadPool* pool)
    : impl_(std::make_unique<Impl>(scene, field, pool)) {}

NativeEngine::~NativeEngine() = default;

scene::ObjectId NativeEngine::add(const scene::ObjectSpec& spec) {
  Impl& s = *impl_;
  const auto material = static_cast<std::size_t>(spec.material);
  s.bodies.add(s.next_id, s.unit.to_world(spec, s.scene_materials[material]), s.materials[material]);
  s.collision.on_bodies_changed(s.bodies.size());
  s.sleep.wake_with_neighbours(s.bodies, s.bodies.id.size() - 1, s.pair_contacts, s.static_contacts);
  return s.next_id++;
}

bool NativeEngine::alive(scene::ObjectId id) const { return impl_->bodies.find(id) >= 0; }

bool NativeEngine::remove(scene::ObjectId id) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  impl_->sleep.wake_with_neighbours(impl_->bodies, static_cast<std::size_t>(index), impl_->pair_contacts,
                                    impl_->static_contacts);
  impl_->bodies.erase(static_cast<std::size_t>(index));
  remove_body(impl_->pair_contacts, index);
  remove_body(impl_->static_contacts, index);
  impl_->sleep.on_body_removed(index);
  impl_->collision.on_body_removed(index);
  impl_->collision.on_bodies_changed(impl_->bodies.size());
  impl_->joints.on_body_removed(index, impl_->bodies);
  std::erase_if(impl_->timed_forces, [id](const TimedForce& p) { return p.id == id; });
  return true;
}

bool NativeEngine::place(scene::ObjectId id, const scene::ObjectStateUpdate& placement) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  impl_->sleep.wake_with_neighbours(impl_->bodies, static_cast<std::size_t>(index), impl_->pair_contacts,
                                    impl_->static_contacts);
  impl_->bodies.apply_placement(static_cast<std::size_t>(index), impl_->unit.to_world(placement));
  return true;
}

bool NativeEngine::apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                               const std::optional<Eigen::Vector3d>& point, double duration_s) {
  const int index = impl_->bodies.find(id);
  if (index < 0) return false;
  const auto i = static_cast<std::size_t>(index);
  const long steps = std::max(1L, std::lround(duration_s / static_cast<double>(impl_->settings.dt_s)));
  const Quat& q = impl_->bodies.orientation[i];
  const LengthUnit& unit = impl_->unit;
  const Vec3 local_point =
      point ? Vec3(q.conjugate() * (unit.to_world(*point).cast<float>() - impl_->bodies.position[i]))
            : Vec3(0, 0, 0);
  impl_->timed_forces.push_back({id, unit.to_world(force).cast<float>(), local_point, steps});
  return true;
}

scene::ObjectState NativeEngine::state(scene::ObjectId id) const {
  const BodyStore& b = impl_->bodies;
  const LengthUnit& unit = impl_->unit;
  const auto i = static_cast<std::size_t>(b.find(id));
  return {unit.to_scene(Eigen::Vector3d(b.origin(i).cast<double>())), b.orientation[i].cast<double>(),
          unit.to_scene(Eigen::Vector3d(b.origin_velocity(i).cast<double>())),
          b.angular_velocity(i).cast<double>()};
}

void NativeEngine::Impl::wake_joint(scene::JointId id) {
  for (const std::int32_t body : joints.bodies_of(id))
    if (body >= 0 && !bodies.is_static(static_cast<std::size_t>(body)))
      sleep.wake(bodies, static_cast<std::size_t>(body));
}

scene::JointId NativeEngine::add_joint(const scene::JointSpec& spec) {
  const scene::JointId id = impl_->joints.add(impl_->unit.to_world(spec), impl_->bodies);
  impl_->wake_joint(id);
  return id;
}

bool NativeEngine::has_joint(scene::JointId id) const { return impl_->joints.contains(id); }

void NativeEngine::remove_joint(scene::JointId id) {
  impl_->wake_joint(id);
  impl_->joints.remove(id, impl_->bodies);
}

void NativeEngine::set_motor(scene::JointId id, const scene::JointMotor& motor) {
  impl_->wake_joint(id);
  impl_->joints.set_motor(id, impl_->unit.to_world(impl_->joints.kind_of(id), motor));
}

void NativeEngine::set_spring(scene::JointId id, const scene::JointSpring& spring) {
  impl_->wake_joint(id);
  impl_->joints.set_spring(id, impl_->unit.to_world(impl_->joints.kind_of(id), spring));
}

scene::JointState NativeEngine::joint_state(scene::JointId id) const {
  return impl_->unit.to_scene(impl_->joints.kind_of(id),
                              impl_->joints.state(id, impl_->bodies, impl_->settings.dt_s));
}

surface::BodyView NativeEngine::bodies() const {
  const Impl& s = *impl_;
  s.scene_velocity.resize(s.bodies.id.size());
  s.angular_velocity.resize(s.bodies.id.size());
  for (std::size_t i = 0; i < s.scene_velocity.size(); ++i) {
    s.scene_velocity[i] = s.unit.to_scene(s.bodies.origin_velocity(i));
    s.angular_velocity[i] = s.bodies.angular_velocity(i);
  }
  const bool are_scene_positions = s.unit.is_one() && !s.bodies.has_offsets;
  if (!are_scene_positions) {
    s.scene_position.clear();
    for (std::size_t i = 0; i < s.bodies.id.size(); ++i)
      s.scene_position.push_back(s.unit.to_scene(s.bodies.origin(i)));
  }
  return {s.bodies.id,          are_scene_positions ? s.bodies.position : s.scene_position,
          s.bodies.orientation, s.scene_velocity,
          s.angular_velocity,   s.bodies.mass};
}

std::span<surface::Wrench> NativeEngine::wrenches() {
  impl_->has_wrenches = true;
  return impl_->bodies.wrench;
}

void NativeEngine::step() { impl_->step(); }

std::vector<ContactPoint> NativeEngine::contacts() const {
  const Impl& s = *impl_;
  std::vector<ContactPoint> out;
  // Bodies that fell asleep in the last step are in both pairs of lists; they count as sleepers.
  auto sleeps = [&](std::int32_t i) { return s.bodies.asleep[static_cast<std::size_t>(i)] != 0; };
  for (const ContactList* list :
       {&s.pair_contacts, &s.static_contacts, &s.sleep.pair_contacts(), &s.sleep.static_contacts()})
    for (const Manifold& m : list->manifolds) {
      const bool is_sleeping = sleeps(m.a) && (m.b < 0 || sleeps(m.b));
      if (is_sleeping && (list == &s.pair_contacts || list == &s.static_contacts)) continue;
      for (int k = m.first; k < m.first + m.count; ++k) {
        const Contact& c = list->contacts[static_cast<std::size_t>(k)];
        const std::int32_t other = other_body(m, c);
        if (c.total_normal_impulse > 0.0F && c.partner != Partner::kSupportedCell)
          out.push_back(
              {s.unit.to_scene(Vec3(s.bodies.position[static_cast<std::size_t>(m.a)] + c.anchor)), c.normal,
               s.unit.to_scene(c.total_normal_impulse), s.bodies.id[static_cast<std::size_t>(m.a)],
               other >= 0 ? std::optional(s.bodies.id[static_cast<std::size_t>(other)]) : std::nullopt});
      }
    }
  auto add_support = [&](std::int32_t body, const Vec3& anchor, float impulse) {
    const auto i = static_cast<std::size_t>(body);
    out.push_back({s.unit.to_scene(Vec3(s.bodies.position[i] + anchor)), Vec3::UnitZ(),
                   s.unit.to_scene(impulse), s.bodies.id[i], std::nullopt});
  };
  for (const SupportPatches& list : s.collision.supports())
    for (const SupportPatch& p : list.patches) {
      if (sleeps(p.body)) continue;
      const SupportSamples& samples = list.samples;
      for (auto i = static_cast<std::size_t>(p.first); i < static_cast<std::size_t>(p.first + p.count); ++i)
        if (samples.load[i] > 0.0F) add_support(p.body, {samples.x[i], samples.y[i], p.z}, samples.load[i]);
    }
  for (const Sleep::SupportLoad& l : s.sleep.support_loads()) add_support(l.body, l.anchor, l.impulse);
  return out;
}

int NativeEngine::sleeping_count() const { return impl_->sleep.sleeping_count(); }

void NativeEngine::snapshot(scene::Snapshot& out) const {
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
      out.position[i] = to_array(impl_->unit.to_scene(b.origin(i)));
      out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
      out.velocity[i] = to_array(impl_->unit.to_scene(b.origin_velocity(i)));
      out.angular_velocity[i] = to_array(b.angular_velocity(i));
    }
  });
  StateHash hash = hash_objects(out);
  impl_->field_hasher.copy_and_hash(impl_->scene_field, impl_->field_changed, out.height, hash);
  impl_->field_changed = false;
  out.skin_height = impl_->scene_field.skin.height;
  out.state_hash = hash.value();
  const Sleep& sleep = impl_->sleep;
  out.contact_count = static_cast<std::uint32_t>(
      impl_->pair_contacts.contacts.size() + impl_->static_contacts.contacts.size() +
      sleep.pair_contacts().contacts.size() + sleep.static_contacts().contacts.size());
}

bool NativeEngine::is_overloaded() const { return impl_->overloaded; }

void NativeEngine::archive(common::StateArchive& a, std::span<const scene::ObjectSpec> catalogue,
                           std::size_t declared) {
  Impl& s = *impl_;
  std::vector<scene::ObjectId> previous_id = s.bodies.id;
  a(s.next_id, s.bodies, s.joints, s.timed_forces, s.pair_contacts, s.static_contacts, s.sleep, s.jam_relief);
  s.collision.archive(a, s.bodies.size());
  a(s.loaded_cells, s.sleeper_cells, s.sleeper_impulse, s.sleeper_impulse_version, s.has_wrenches,
    s.field_moved);
  if (!s.unit.is_one()) s.field_copy.archive_motion(a);
  if (a.saves()) return;
  s.field_changed = true;
  s.loaded_tips.clear();
  for (std::size_t i = 0; i < s.scene_field.tip_impulse.size(); ++i)
    if (!s.scene_field.tip_impulse[i].isZero(0.0F)) s.loaded_tips.push_back(static_cast<std::int32_t>(i));
  if (s.bodies.id == previous_id && (previous_id.empty() || previous_id.back() < declared)) return;
  std::vector<std::unique_ptr<const Shape>> previous_shape = std::move(s.bodies.shape);
  s.bodies.shape.clear();
  for (const scene::ObjectId id : s.bodies.id) {
    const auto known = std::ranges::lower_bound(previous_id, id);
    if (id < declared && known != previous_id.end() && *known == id) {
      s.bodies.shape.push_back(
          std::move(previous_shape[static_cast<std::size_t>(known - previous_id.begin())]));
      continue;
    }
    const scene::ObjectSpec& spec = catalogue[id];
    const scene::Material& material = s.scene_materials[static_cast<std::size_t>(spec.material)];
    s.bodies.shape.push_back(std::make_unique<const Shape>(make_shape(s.unit.to_world(spec, material))));
  }
}

std::optional<scene::ObjectId> NativeEngine::first_non_finite() const {
  const BodyStore& b = impl_->bodies;
  for (std::size_t i = 0; i < b.id.size(); ++i)
    if (!b.position[i].allFinite() || !b.velocity(i).allFinite() || !b.angular_velocity(i).allFinite())
      return b.id[i];
  return std::nullopt;
}

}  // namespace smartsurf::world
