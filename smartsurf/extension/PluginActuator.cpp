#include "smartsurf/extension/PluginActuator.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::extension {

PluginActuator::PluginActuator(const smartsurf_plugin_actuator& type,
                               std::span<const scene::Parameter> parameters, float min_height,
                               const surface::ActuatorContext& context)
    : type_(type),
      surface_(context.field),
      values_(values_of(parameters, context.spec.values)),
      targets_(type.channel_count, std::vector<float>(context.field.height.size(), 0.0F)) {
  for (const surface::CellRun& run : context.runs)
    for (int i = run.begin; i < run.end; ++i) cells_.push_back(static_cast<std::uint32_t>(i));
  for (const std::vector<float>& targets : targets_) target_pointers_.push_back(targets.data());
  if (has_force_limit()) {
    force_limit_.assign(context.field.height.size(), std::numeric_limits<float>::infinity());
    planned_speed_.assign(force_limit_.size(), 0.0F);
    retry_wait_ = planned_speed_;
    lower_stop_ = context.field.height;
    for (const std::uint32_t cell : cells_) lower_stop_[cell] += min_height - context.number("height");
  }
  Message message{};
  const smartsurf_plugin_actuator_context plugin_context{
      .size = sizeof plugin_context,
      .cell_count = static_cast<std::uint32_t>(cells_.size()),
      .surface = surface_.get(),
      .values = values_.data(),
      .cells = cells_.data(),
      .height = context.field.height.data(),
      .message = message.data()};
  instance_ = type.create(&plugin_context);
  require_created(instance_, type.name, message);
}

smartsurf_plugin_motion PluginActuator::motion(double dt_s, surface::Field& field) noexcept {
  const auto data = [](std::vector<float>& values) { return values.empty() ? nullptr : values.data(); };
  smartsurf_plugin_motion motion{.size = sizeof motion,
                                 .targets_changed = targets_changed_,
                                 .dt_s = dt_s,
                                 .targets = target_pointers_.data(),
                                 .impulse = field.impulse.data(),
                                 .height = field.height.data(),
                                 .speed = field.speed.data(),
                                 .surface_velocity_x = nullptr,
                                 .surface_velocity_y = nullptr,
                                 .surface_spin = nullptr,
                                 .force_limit = nullptr,
                                 .no_load_speed = nullptr};
  if (has_surface_velocity()) {
    motion.surface_velocity_x = data(field.surface_velocity_x);
    motion.surface_velocity_y = data(field.surface_velocity_y);
    motion.surface_spin = data(field.surface_spin);
  }
  if (has_force_limit()) {
    motion.force_limit = force_limit_.data();
    motion.no_load_speed = data(field.no_load_speed);
  }
  return motion;
}

void PluginActuator::set_targets(int channel, std::span<const float> targets) noexcept {
  std::ranges::copy(targets, targets_[channel].begin());
  targets_changed_ = true;
}

void PluginActuator::snap_to_targets(surface::Field& field) noexcept {
  if (type_.snap == nullptr) return;
  const smartsurf_plugin_motion at_rest = motion(0.0, field);
  type_.snap(instance_, &at_rest);
}

void PluginActuator::plan(double dt_s, surface::Field& field) noexcept {
  const smartsurf_plugin_motion step = motion(dt_s, field);
  type_.plan(instance_, &step);
  targets_changed_ = false;
  refused_.reset();
  for (const std::uint32_t cell : cells_)
    if (const char* const what = refused_motion(cell, field)) {
      refused_ = {static_cast<int>(cell), what};
      return;
    }
  if (has_force_limit())
    for (const std::uint32_t cell : cells_) plan_under_load(cell, static_cast<float>(dt_s), field);
  if (!has(SMARTSURF_MOVES_TOPS)) return;
  for (const std::uint32_t cell : cells_) {
    const float speed = field.speed[cell];
    field.max_speed = std::max(field.max_speed, std::abs(speed));
    field.max_height =
        std::max(field.max_height, field.height[cell] + std::max(speed, 0.0F) * static_cast<float>(dt_s));
  }
}

const char* PluginActuator::refused_motion(std::uint32_t cell, const surface::Field& field) const noexcept {
  if (!std::isfinite(field.height[cell])) return "a height that is not finite";
  if (!std::isfinite(field.speed[cell])) return "a speed that is not finite";
  if (!has(SMARTSURF_MOVES_TOPS) && field.speed[cell] != 0.0F)
    return "a speed without the flag SMARTSURF_MOVES_TOPS";
  if (has_surface_velocity()) {
    if (!std::isfinite(field.surface_velocity_x[cell]) || !std::isfinite(field.surface_velocity_y[cell]))
      return "a surface velocity that is not finite";
    if (!std::isfinite(field.surface_spin[cell])) return "a surface spin that is not finite";
  }
  if (has_force_limit() && force_limit_[cell] != std::numeric_limits<float>::infinity()) {
    if (!(force_limit_[cell] >= 0.0F)) return "a force limit that is not 0 or more";
    const float no_load_speed = field.no_load_speed[cell];
    if (!std::isfinite(no_load_speed) || no_load_speed <= 0.0F)
      return "a no-load speed that is not finite and greater than 0";
  }
  return nullptr;
}

// As pins do: on the lower stop the frame carries the load.
void PluginActuator::plan_under_load(std::uint32_t cell, float dt_s, surface::Field& field) noexcept {
  float& speed = field.speed[cell];
  const float room = field.height[cell] - lower_stop_[cell];
  const bool on_stop = room <= surface::kStopTolerance * field.pitch;
  speed = std::max(speed, -std::max(room, 0.0F) / dt_s);
  if (on_stop && retry_wait_[cell] > 0.0F) {
    retry_wait_[cell] -= dt_s;
    speed = std::min(speed, 0.0F);
  }
  planned_speed_[cell] = speed;
  field.force_limit[cell] =
      on_stop && speed <= 0.0F ? std::numeric_limits<float>::infinity() : force_limit_[cell];
}

void PluginActuator::commit(double dt_s, surface::Field& field) noexcept {
  if (!has(SMARTSURF_MOVES_TOPS)) return;
  for (const std::uint32_t cell : cells_) field.height[cell] += field.speed[cell] * static_cast<float>(dt_s);
  if (!has_force_limit()) return;
  for (const std::uint32_t cell : cells_) {
    float& height = field.height[cell];
    height = std::max(height, lower_stop_[cell]);
    if (height <= lower_stop_[cell] + surface::kStopTolerance * field.pitch && planned_speed_[cell] > 0.0F &&
        field.speed[cell] <= 0.0F)
      retry_wait_[cell] = surface::kRetryDelay_s;
  }
}

void PluginActuator::add_forces(double dt_s, const surface::Field& field, const surface::BodyView& bodies,
                                std::span<const scene::ObjectSpec> catalogue,
                                std::span<surface::Wrench> wrenches) noexcept {
  static_assert(sizeof(surface::Wrench) == 6 * sizeof(float));
  if (bodies.size() == 0) return;
  smartsurf_plugin_objects objects{};
  objects.size = sizeof objects;
  objects.count = static_cast<std::uint32_t>(bodies.size());
  objects.id = bodies.id.data();
  objects.position = bodies.position.front().data();
  objects.orientation = bodies.orientation.front().coeffs().data();
  objects.velocity = bodies.velocity.front().data();
  objects.angular_velocity = bodies.angular_velocity.front().data();
  objects.mass = bodies.mass.data();
  objects_.describe(catalogue, objects);
  type_.add_forces(instance_, dt_s, field.height.data(), &objects, wrenches.front().force.data());
  for (std::size_t i = 0; i < bodies.size() && !refused_; ++i)
    if (!wrenches[i].force.allFinite() || !wrenches[i].torque.allFinite())
      refused_ = {static_cast<int>(i), "a force or a torque that is not finite", true};
}

void PluginActuator::archive(common::StateArchive& a) {
  if (type_.save == nullptr || type_.restore == nullptr)
    throw common::UserError("an actuator of this surface cannot be saved: '" + std::string(type_.name) +
                            "' has no save and restore");
  a(targets_, targets_changed_, force_limit_, planned_speed_, retry_wait_);
  const std::string subject =
      scene::find_actuator_kind(type_.name)->extension.name + ": actuator '" + type_.name + "'";
  archive_instance(a, subject, instance_, type_.save, type_.restore);
  objects_.invalidate();
}

}  // namespace smartsurf::extension
