#include "smartsurf/world/NativeEngine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "smartsurf/world/Substeps.h"

namespace smartsurf::world {
namespace {

float ground_height(const scene::SceneSpec& s, const LengthUnit& unit) {
  return s.world.ground ? static_cast<float>(unit.to_world(s.surface.ground_height()))
                        : -std::numeric_limits<float>::infinity();
}

StepSettings make_step_settings(const scene::SceneSpec& s, const LengthUnit& unit) {
  const scene::Material m = unit.to_world(s.materials[s.surface.material]);
  return {.dt_s = static_cast<float>(s.world.dt_s),
          .substeps = substeps_of(s.world.iterations),
          .gravity = unit.to_world(s.world.gravity).cast<float>(),
          .field_material = {.radius = 0.0F,
                             .friction_root = std::sqrt(static_cast<float>(m.friction)),
                             .rolling_friction_root = std::sqrt(static_cast<float>(m.rolling_friction)),
                             .restitution = static_cast<float>(m.restitution)}};
}

std::array<float, 3> to_array(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

// Sleep's limits are for a pitch of 1 u. On a coarser surface objects need not be large: they grow with the
// pitch only as far as gravity does, as in a scene in millimetres.
float rest_scale(const scene::SceneSpec& scene) {
  const double pitch = scene.surface.pitch;
  if (pitch <= 1.0) return 1.0F;
  return static_cast<float>(std::clamp(scene.world.gravity.norm() / scene::kStandardGravity, 1.0, pitch) /
                            pitch);
}

}  // namespace

NativeEngine::NativeEngine(const scene::SceneSpec& scene, surface::Field& field, common::ThreadPool* pool)
    : unit_(scene.surface.pitch),
      scene_materials_(scene.materials),
      scene_field_(field),
      field_copy_(unit_.is_one() ? surface::Field() : unit_.to_world(field)),
      field_(unit_.is_one() ? field : field_copy_),
      settings_(make_step_settings(scene, unit_)),
      pool_(pool),
      team_(pool),
      sleep_(field_,
             {.gravity = settings_.gravity,
              .dt_s = settings_.dt_s,
              .substeps = settings_.substeps,
              .field_material = settings_.field_material},
             rest_scale(scene), scene.world.sleep),
      collision_(field_, settings_.dt_s, settings_.substeps, ground_height(scene, unit_),
                 settings_.gravity.norm()),
      elastic_skin_(settings_.dt_s, settings_.gravity.z(), settings_.substeps),
      jam_relief_(settings_.dt_s),
      stops_of_members_(team_.member_count()),
      field_hasher_(pool) {
  for (const scene::Material& material : scene.materials) materials_.push_back(unit_.to_world(material));
  scene_field_.impulse.assign(scene_field_.height.size(), 0.0F);
  add_all(scene);
}

void NativeEngine::wake_with_neighbours(std::int32_t body) {
  write_impulses();  // with those that sleep now
  sleep_.wake_with_neighbours(bodies_, body, pair_contacts_, static_contacts_);
}

scene::ObjectId NativeEngine::add(const scene::ObjectSpec& spec) {
  bodies_.add(next_id_, unit_.to_world(spec, scene_materials_[spec.material]), materials_[spec.material]);
  collision_.on_bodies_changed(bodies_.size());
  active_version_.reset();
  wake_with_neighbours(bodies_.size() - 1);
  return next_id_++;
}

bool NativeEngine::remove(scene::ObjectId id) {
  const int index = bodies_.find(id);
  if (index < 0) return false;
  wake_with_neighbours(index);
  bodies_.erase(index);
  active_version_.reset();
  active_bodies_.clear();
  remove_body(pair_contacts_, index);
  remove_body(static_contacts_, index);
  sleep_.on_body_removed(index);
  collision_.on_body_removed(index);
  collision_.on_bodies_changed(bodies_.size());
  joints_.on_body_removed(index, bodies_);
  std::erase_if(timed_forces_, [id](const TimedForce& p) { return p.id == id; });
  return true;
}

bool NativeEngine::set_state(scene::ObjectId id, const scene::ObjectStateUpdate& update) {
  const int index = bodies_.find(id);
  if (index < 0) return false;
  wake_with_neighbours(index);
  bodies_.set_state(index, unit_.to_world(update));
  return true;
}

bool NativeEngine::apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                               const std::optional<Eigen::Vector3d>& point, double duration_s) {
  const int index = bodies_.find(id);
  if (index < 0) return false;
  const auto local_point = [&]() -> Vec3 {
    if (!point) return Vec3::Zero();
    return bodies_.orientation[index].conjugate() *
           (unit_.to_world(*point).cast<float>() - bodies_.position[index]);
  };
  timed_forces_.push_back({id, unit_.to_world(force).cast<float>(), local_point(),
                           StepCountdown(duration_s, static_cast<double>(settings_.dt_s))});
  return true;
}

scene::ObjectState NativeEngine::state(scene::ObjectId id) const {
  const int i = bodies_.find(id);
  return {unit_.to_scene(Eigen::Vector3d(bodies_.origin(i).cast<double>())),
          bodies_.orientation[i].cast<double>(),
          unit_.to_scene(Eigen::Vector3d(bodies_.origin_velocity(i).cast<double>())),
          bodies_.angular_velocity(i).cast<double>()};
}

void NativeEngine::wake_joint(scene::JointId id) {
  write_impulses();
  for (const std::int32_t body : joints_.bodies_of(id))
    if (body >= 0 && !bodies_.is_static(body)) sleep_.wake_island(bodies_, body);
}

scene::JointId NativeEngine::add_joint(const scene::JointSpec& spec) {
  const scene::JointId id = joints_.add(unit_.to_world(spec), bodies_);
  wake_joint(id);
  return id;
}

void NativeEngine::remove_joint(scene::JointId id) {
  wake_joint(id);
  joints_.remove(id, bodies_);
}

void NativeEngine::set_motor(scene::JointId id, const scene::JointMotor& motor) {
  wake_joint(id);
  joints_.set_motor(id, unit_.to_world(joints_.kind_of(id), motor));
}

void NativeEngine::set_spring(scene::JointId id, const scene::JointSpring& spring) {
  wake_joint(id);
  joints_.set_spring(id, unit_.to_world(joints_.kind_of(id), spring));
}

scene::JointState NativeEngine::joint_state(scene::JointId id) const {
  return unit_.to_scene(joints_.kind_of(id), joints_.state(id, bodies_, settings_.dt_s));
}

surface::BodyView NativeEngine::bodies() const {
  const std::size_t count = bodies_.id.size();
  for (std::vector<Vec3>* of_all : {&scene_position_, &scene_velocity_, &angular_velocity_})
    of_all->resize(count);
  orientation_.resize(count);
  const float lead_s = mean_substep_start(settings_.dt_s, settings_.substeps);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 velocity = bodies_.origin_velocity(i);
    scene_velocity_[i] = unit_.to_scene(velocity);
    scene_position_[i] = unit_.to_scene(Vec3(bodies_.origin(i) + lead_s * velocity));
    angular_velocity_[i] = bodies_.angular_velocity(i);
    orientation_[i] = rotation_from_vector(lead_s * angular_velocity_[i]) * bodies_.orientation[i];
  }
  return {bodies_.id, scene_position_, orientation_, scene_velocity_, angular_velocity_, bodies_.mass};
}

std::span<surface::Wrench> NativeEngine::wrenches() {
  has_wrenches_ = true;
  return bodies_.wrench;
}

// Finds the loads that the solver would have stored at the end of the step.
void NativeEngine::find_loads() const {
  if (!std::exchange(lacks_loads_, false)) return;
  std::vector<std::int32_t> manifold_of(bodies_.id.size());
  for (std::size_t k = 0; k < static_contacts_.manifolds.size(); ++k)
    manifold_of[static_contacts_.manifolds[k].a] = static_cast<std::int32_t>(k);
  for (SupportPatches& list : collision_.supports())
    for (SupportPatch& p : list.patches)
      if (finds_loads_when_asked(p))
        store_loads(list, p, static_contacts_.contacts_of(static_contacts_.manifolds[manifold_of[p.body]]));
}

void NativeEngine::write_impulses() {
  if (!std::exchange(lacks_impulses_, false)) return;
  find_loads();
  write_cell_impulses();
}

std::vector<ContactPoint> NativeEngine::contacts() const {
  find_loads();
  std::vector<ContactPoint> out;
  // Bodies that fell asleep in the last step are in both pairs of lists; they count as sleepers.
  auto sleeps = [&](std::int32_t i) { return bodies_.asleep[i] != 0; };
  const auto add_contacts = [&](const Manifold& m, std::span<const Contact> contacts) {
    for (const Contact& c : contacts) {
      const std::int32_t other = other_body(m, c);
      if (c.total_normal_impulse <= 0.0F || c.is_in_patch()) continue;
      out.push_back({unit_.to_scene(Vec3(bodies_.position[m.a] + c.anchor)), c.normal,
                     unit_.to_scene(c.total_normal_impulse), bodies_.id[m.a],
                     other >= 0 ? std::optional(bodies_.id[other]) : std::nullopt});
    }
  };
  for (const ContactList* list : {&pair_contacts_, &static_contacts_})
    for (const Manifold& m : list->manifolds)
      if (!sleeps(m.a) || (m.b >= 0 && !sleeps(m.b))) add_contacts(m, list->contacts_of(m));
  sleep_.contacts().for_each_pair(add_contacts);
  sleep_.contacts().for_each_static(add_contacts);
  const auto add_support = [&](const SupportPatch& p, const SupportSamples& s, Index i) {
    out.push_back({unit_.to_scene(Vec3(bodies_.position[p.body] + Vec3(s.x[i], s.y[i], p.z))), Vec3::UnitZ(),
                   unit_.to_scene(s.load[i]), bodies_.id[p.body], std::nullopt});
  };
  for_each_awake_support(add_support);
  sleep_.contacts().for_each_loaded_sample(add_support);
  return out;
}

NativeEngine::StepWork NativeEngine::step_work() const {
  if (active_bodies_.empty()) return {};
  return {active_bodies_.size(), collision_.bodies_in_grid().size(),
          static_cast<std::size_t>(collision_.partition().row_count()), collision_.tested_pairs(),
          pair_contacts_.contacts.size() + static_contacts_.contacts.size()};
}

void NativeEngine::snapshot(scene::Snapshot& out, bool with_hash) const {
  const BodyStore& b = bodies_;
  const std::size_t n = b.id.size();
  out.id = b.id;
  out.position.resize(n);
  out.orientation.resize(n);
  out.velocity.resize(n);
  out.angular_velocity.resize(n);
  // Each thread copies the bodies that it simulated, which are still in its cache.
  team_.run(n >= kMinParallelBodies, [&](const Member& member) {
    for (const std::int32_t i : collision_.own_bodies(member)) {
      const Quat& q = b.orientation[i];
      out.position[i] = to_array(unit_.to_scene(b.origin(i)));
      out.orientation[i] = {q.x(), q.y(), q.z(), q.w()};
      out.velocity[i] = to_array(unit_.to_scene(b.origin_velocity(i)));
      out.angular_velocity[i] = to_array(b.angular_velocity(i));
    }
  });
  if (with_hash) {
    StateHash hash = hash_objects(out);
    field_hasher_.copy_and_hash(scene_field_, field_changed_, out.height, hash);
    field_changed_ = false;
    out.state_hash = hash.value();
  } else {
    out.height = scene_field_.height;
  }
  out.skin_height = scene_field_.skin.height;
  out.contact_count = static_cast<std::uint32_t>(
      pair_contacts_.contacts.size() + static_contacts_.contacts.size() + sleep_.contacts().contact_count());
}

void NativeEngine::archive(common::StateArchive& a, std::span<const scene::ObjectSpec> catalogue,
                           std::size_t declared) {
  std::vector<scene::ObjectId> previous_id = bodies_.id;
  if (a.saves()) write_impulses();
  lacks_loads_ = lacks_impulses_ = false;
  a(next_id_, bodies_, joints_, timed_forces_, pair_contacts_, static_contacts_, tips_, sleep_, jam_relief_);
  collision_.archive(a, bodies_.size());
  a(loaded_cells_, sleeper_cells_, sleeper_impulse_, sleeper_impulse_version_, has_wrenches_, field_moved_);
  if (!unit_.is_one()) field_copy_.archive_motion(a);
  if (a.saves()) return;
  field_changed_ = true;
  active_version_.reset();
  active_bodies_.clear();
  loaded_tips_.clear();
  for (std::size_t i = 0; i < scene_field_.tip_impulse.size(); ++i)
    if (!scene_field_.tip_impulse[i].isZero(0.0F)) loaded_tips_.push_back(static_cast<std::int32_t>(i));
  if (bodies_.id == previous_id && (previous_id.empty() || previous_id.back() < declared)) return;
  std::vector<std::unique_ptr<const Shape>> previous_shape = std::move(bodies_.shape);
  bodies_.shape.clear();
  for (const scene::ObjectId id : bodies_.id) {
    const auto known = std::ranges::lower_bound(previous_id, id);
    if (id < declared && known != previous_id.end() && *known == id) {
      bodies_.shape.push_back(std::move(previous_shape[known - previous_id.begin()]));
      continue;
    }
    const scene::ObjectSpec& spec = catalogue[id];
    const scene::Material& material = scene_materials_[spec.material];
    bodies_.shape.push_back(std::make_unique<const Shape>(make_shape(unit_.to_world(spec, material))));
  }
}

std::optional<scene::ObjectId> NativeEngine::first_non_finite() const {
  const BodyStore& b = bodies_;
  for (const std::int32_t i : active_bodies_)  // no other body has moved
    if (!b.position[i].allFinite() || !b.velocity(i).allFinite() || !b.angular_velocity(i).allFinite())
      return b.id[i];
  return std::nullopt;
}

}  // namespace smartsurf::world
