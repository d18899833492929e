#include "smartsurf/world/LengthUnit.h"

#include <algorithm>
#include <utility>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::world {
namespace {

constexpr double kCostPerCell_ns = 0.5;

surface::YieldingTip scaled(const surface::YieldingTip& tip, float factor) {
  return {tip.held_position * factor, tip.held_velocity * factor, tip.deflection * factor,
          tip.deflection_rate * factor};
}

}  // namespace

scene::ObjectSpec LengthUnit::to_world(const scene::ObjectSpec& from, const scene::Material& material) {
  scene::ObjectSpec to = from;
  if (is_one()) return to;
  if (!from.fixed && !from.mass) to.mass = material.density * from.volume();
  to.radius *= to_world_;
  to.height *= to_world_;
  to.size *= to_world_;
  to.position *= to_world_;
  to.velocity *= to_world_;
  to.centre_of_mass *= to_world_;
  if (to.inertia) *to.inertia *= to_world_ * to_world_;
  if (from.solid) {
    std::erase_if(solids_, [](const ConvertedSolid& s) { return s.scene.expired() || s.world.expired(); });
    const auto known = std::ranges::find_if(
        solids_, [&from](const ConvertedSolid& s) { return s.scene.lock() == from.solid; });
    to.solid = known != solids_.end() ? known->world.lock()
                                      : std::make_shared<const scene::Solid>(scaled(*from.solid, to_world_));
    if (known == solids_.end()) solids_.push_back({from.solid, to.solid});
  }
  return to;
}

scene::ObjectStateUpdate LengthUnit::to_world(scene::ObjectStateUpdate update) const {
  if (update.position) *update.position *= to_world_;
  if (update.velocity) *update.velocity *= to_world_;
  return update;
}

scene::Material LengthUnit::to_world(scene::Material material) const {
  material.rolling_friction *= to_world_;
  return material;
}

LengthUnit::JointScales LengthUnit::joint_scales(scene::JointKind kind) const {
  return kind == scene::JointKind::kSlider ? JointScales{to_world_, to_world_, 1.0}
                                           : JointScales{1.0, to_world_ * to_world_, to_world_ * to_world_};
}

scene::JointSpec LengthUnit::to_world(scene::JointSpec j) const {
  const JointScales scale = joint_scales(j.kind);
  j.anchor *= to_world_;
  if (j.limits) j.limits->lower *= scale.coordinate, j.limits->upper *= scale.coordinate;
  j.friction *= scale.effort;
  if (j.spring) j.spring = to_world(j.kind, *j.spring);
  if (j.motor) j.motor = to_world(j.kind, *j.motor);
  return j;
}

scene::JointSpring LengthUnit::to_world(scene::JointKind kind, scene::JointSpring spring) const {
  const JointScales scale = joint_scales(kind);
  spring.stiffness *= scale.stiffness, spring.damping *= scale.stiffness, spring.rest *= scale.coordinate;
  return spring;
}

scene::JointMotor LengthUnit::to_world(scene::JointKind kind, scene::JointMotor motor) const {
  const JointScales scale = joint_scales(kind);
  motor.speed *= scale.coordinate, motor.max_effort *= scale.effort;
  return motor;
}

scene::JointState LengthUnit::to_scene(scene::JointKind kind, scene::JointState s) const {
  const bool is_slider = kind == scene::JointKind::kSlider;
  if (is_slider) s.coordinate *= to_scene_, s.speed *= to_scene_;
  s.effort *= is_slider ? to_scene_ : to_scene_ * to_scene_;
  s.force *= to_scene_;
  return s;
}

surface::Wrench LengthUnit::to_world(const surface::Wrench& w) const {
  return {w.force * to_world_f_, w.torque * (to_world_f_ * to_world_f_)};
}

surface::Field LengthUnit::to_world(const surface::Field& scene) const {
  surface::Field world = scene;
  for (float* length : {&world.pitch, &world.half_top_x, &world.half_top_y})
    *length = static_cast<float>(static_cast<double>(*length) * to_world_);
  world.pitch = 1.0F;
  world.max_speed = 1.0F;  // makes the first update convert everything
  for (std::vector<float>* lengths : {&world.x, &world.y})
    for (float& length : *lengths) length *= to_world_f_;
  world.tip_reach *= to_world_f_;
  surface::Skin& skin = world.skin;
  for (float* length : {&skin.west, &skin.north, &skin.spacing_x, &skin.spacing_y}) *length *= to_world_f_;
  skin.density *= to_scene_f_ * to_scene_f_;
  for (surface::CellTip& tip : world.tips)
    for (float* length : {&tip.radius, &tip.height, &tip.max_force, &tip.workspace_radius, &tip.workspace_low,
                          &tip.workspace_high})
      *length *= to_world_f_;
  return world;
}

void LengthUnit::update_motion(const surface::Field& scene, surface::Field& world,
                               common::ThreadPool* pool) const {
  // Heights also change by the last step's speeds, which the copy still has.
  const bool moves = scene.max_speed != 0.0F || world.max_speed != 0.0F || scene.has_force_limit() ||
                     scene.has_surface_velocity() || !scene.yielding.empty() ||
                     world.max_height != scene.max_height * to_world_f_;
  world.max_height = scene.max_height * to_world_f_;
  world.max_speed = scene.max_speed * to_world_f_;
  if (scene.has_skin()) update_skin(scene.skin, world.skin);
  if (!moves) return;
  auto convert_rows = [&](Index begin_row, Index end_row) {
    const Index begin = begin_row * scene.columns, end = end_row * scene.columns;
    const auto convert = [&](const std::vector<float>& from, std::vector<float>& to) {
      for (Index i = begin; !from.empty() && i < end; ++i) to[i] = from[i] * to_world_f_;
    };
    const auto copy = [&](const auto& from, auto& to) {
      if (!from.empty()) std::copy(from.begin() + begin, from.begin() + end, to.begin() + begin);
    };
    convert(scene.height, world.height);
    convert(scene.speed, world.speed);
    convert(scene.surface_velocity_x, world.surface_velocity_x);
    convert(scene.surface_velocity_y, world.surface_velocity_y);
    copy(scene.surface_spin, world.surface_spin);
    convert(scene.force_limit, world.force_limit);
    convert(scene.no_load_speed, world.no_load_speed);
    for (Index i = begin; scene.has_offset() && i < end; ++i) {
      world.offset[i] = scene.offset[i] * to_world_f_;
      world.offset_rate[i] = scene.offset_rate[i] * to_world_f_;
      if (!scene.yielding.empty()) world.yielding[i] = scaled(scene.yielding[i], to_world_f_);
    }
    copy(scene.tilt, world.tilt);
    copy(scene.tilt_rate, world.tilt_rate);
  };
  if (pool != nullptr)
    pool->parallel_for_rows(scene.rows, kCostPerCell_ns * scene.cells(), convert_rows);
  else
    convert_rows(0, scene.rows);
}

void LengthUnit::update_skin(const surface::Skin& scene, surface::Skin& world) const {
  world.supports_move = scene.supports_move;
  world.held = scene.held;
  const auto convert = [this](const std::vector<float>& from, std::vector<float>& to) {
    std::ranges::transform(from, to.begin(), [this](float u) { return u * to_world_f_; });
  };
  convert(scene.height, world.height);
  convert(scene.speed, world.speed);
  convert(scene.support_height, world.support_height);
  convert(scene.support_speed, world.support_speed);
}

void LengthUnit::return_skin(const surface::Skin& world, surface::Skin& scene) const {
  for (std::size_t i = 0; i < world.nodes(); ++i) {
    scene.height[i] = world.height[i] * to_scene_f_;
    scene.speed[i] = world.speed[i] * to_scene_f_;
  }
  scene.held = world.held;
}

void LengthUnit::return_lowered_speeds(const surface::Field& world, surface::Field& scene) const {
  for (std::size_t i = 0; i < scene.speed.size(); ++i)
    if (world.speed[i] != scene.speed[i] * to_world_f_) scene.speed[i] = world.speed[i] * to_scene_f_;
}

void LengthUnit::return_yielding_tip(const surface::Field& world, std::size_t cell,
                                     surface::Field& scene) const {
  scene.speed[cell] = world.speed[cell] * to_scene_f_;
  scene.offset_rate[cell] = world.offset_rate[cell] * to_scene_f_;
  const surface::YieldingTip scaled_tip = scaled(world.yielding[cell], to_scene_f_);
  scene.yielding[cell].held_velocity = scaled_tip.held_velocity;
  scene.yielding[cell].deflection_rate = scaled_tip.deflection_rate;
}

}  // namespace smartsurf::world
