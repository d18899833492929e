// Actuators of an extension. Internal to this module.
#pragma once

#include "smartsurf/extension/PluginTables.h"
#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::extension {

class PluginActuator final : public surface::Actuator {
 public:
  // `type` must outlive the process; `parameters` are its own. min_height: of the tops above their base, u.
  // Throws common::UserError if it creates no instance.
  PluginActuator(const smartsurf_plugin_actuator& type, std::span<const scene::Parameter> parameters,
                 float min_height, const surface::ActuatorContext&);
  ~PluginActuator() override { type_.destroy(instance_); }

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(surface::Field&) noexcept override;
  void plan(double dt_s, surface::Field&) noexcept override;
  void commit(double dt_s, surface::Field&) noexcept override;
  bool has_surface_velocity() const noexcept override { return has(SMARTSURF_MOVES_SURFACE); }
  bool has_force_limit() const noexcept override { return has(SMARTSURF_LIMITS_FORCE); }
  bool needs_impulses() const noexcept override { return true; }
  bool exerts_forces() const noexcept override { return has(SMARTSURF_EXERTS_FORCES); }
  void add_forces(double dt_s, const surface::Field&, const surface::BodyView&,
                  std::span<const scene::ObjectSpec> catalogue, std::span<surface::Wrench>) noexcept override;
  std::optional<surface::RefusedOutput> refused_output() const noexcept override { return refused_; }
  void archive(common::StateArchive&) override;

 private:
  bool has(smartsurf_plugin_actuator_flags flag) const noexcept { return (type_.flags & flag) != 0; }
  smartsurf_plugin_motion motion(double dt_s, surface::Field&) noexcept;
  // Why the cell's motion is refused, or null.
  const char* refused_motion(std::uint32_t cell, const surface::Field&) const noexcept;
  void plan_under_load(std::uint32_t cell, float dt_s, surface::Field&) noexcept;

  const smartsurf_plugin_actuator& type_;
  PluginSurface surface_;
  std::vector<smartsurf_plugin_value> values_;
  std::vector<std::uint32_t> cells_;
  std::vector<std::vector<float>> targets_;    // by channel
  std::vector<const float*> target_pointers_;  // to them
  bool targets_changed_ = true;
  std::optional<surface::RefusedOutput> refused_;
  // rows × columns; empty without a force limit. What the extension wrote, mass·u/s²; the least z of each
  // top, u; planned speed before loads, u/s; remaining wait on the lower stop, s.
  std::vector<float> force_limit_, lower_stop_, planned_speed_, retry_wait_;
  ObjectTable objects_;
  void* instance_;
};

}  // namespace smartsurf::extension
