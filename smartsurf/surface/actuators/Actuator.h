// Interface of an actuator model, which drives all cells of one kind: turns targets into cell motion and
// forces on objects. CONTRIBUTING.md says how to add one to this tree, docs/extending.md how to add one as an
// extension.
//
// One physics step: plan(), add_forces() if exerts_forces(), the physics step, commit(). Only the constructor
// may allocate or throw. A model accesses the field entries of its own cells only.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/state/StateArchive.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/actuators/BodyForces.h"
#include "smartsurf/surface/actuators/CellRun.h"

namespace smartsurf::surface {

// The arguments of a model's constructor. The field has its geometry, and its heights are the rest heights.
struct ActuatorContext {
  const scene::SurfaceSpec& surface;
  const scene::ActuatorSpec& spec;
  std::vector<CellRun> runs;  // the model's cells, ascending; excludes a fixed border
  const Field& field;
  common::ThreadPool* pool = nullptr;  // shares work on many cells; may be null

  float number(std::string_view parameter) const { return static_cast<float>(spec.number(parameter)); }
};

// The tip of a model's cells.
struct TipKind {
  CellTip tip;
  float reach = 0.0F;  // upper bound of the horizontal distance of its points from the cell's centre, u
};

// Motion or forces with which the physics cannot go on.
struct RefusedOutput {
  int index;         // of the cell, or of the body among those of add_forces()
  const char* what;  // "a speed that is not finite"
  bool is_force = false;
};

// A cell with a force limit on its lower stop, where the frame carries the load: one that cannot leave the
// stop under its load waits before it tries again.
inline constexpr float kStopTolerance = 1e-4F;  // pitches
inline constexpr float kRetryDelay_s = 0.1F;

class Actuator {
 public:
  Actuator() = default;
  Actuator(const Actuator&) = delete;
  Actuator& operator=(const Actuator&) = delete;
  virtual ~Actuator() = default;

  // Sets the targets of the model's cells. targets: rows × columns, row-major, row 0 north, in the channel's
  // unit; entries of the model's cells are within the channel's range, the others are undefined. `channel`
  // indexes the kind's channel list.
  virtual void set_targets(int channel, std::span<const float> targets) noexcept = 0;

  // Moves the cells to their targets at once, before the first step.
  virtual void snap_to_targets(Field&) noexcept = 0;

  // Writes speed, surface velocity and spin for the coming step, and raises max_height and max_speed to at
  // least those of the model's cells.
  virtual void plan(double dt_s, Field&) noexcept = 0;
  // Advances the heights by `speed`. Models with fixed tops do not override it.
  virtual void commit(double /*dt_s*/, Field&) noexcept {}

  // True if any cell has a surface velocity. If so, the field has surface_velocity_x, _y and surface_spin.
  virtual bool has_surface_velocity() const noexcept { return false; }

  // True if the cells have a force limit. If so, the field has force_limit, which plan() writes.
  virtual bool has_force_limit() const noexcept { return false; }

  // The tip of the model's cells; none if they are columns. If any tip is a plate, the field has tilt and
  // tilt_rate: plan() writes the rates of the coming step, commit() advances the tilt. If any moves sideways,
  // the same holds for offset and offset_rate, and if any yields, for `yielding`.
  virtual std::optional<TipKind> tip() const noexcept { return std::nullopt; }

  // True if the model reads Field::impulse.
  virtual bool needs_impulses() const noexcept { return false; }

  virtual bool exerts_forces() const noexcept { return false; }
  // Adds the forces of the coming step to the wrenches, one per body. catalogue[id] describes object `id`.
  virtual void add_forces(double /*dt_s*/, const Field&, const BodyView&,
                          std::span<const scene::ObjectSpec> /*catalogue*/, std::span<Wrench>) noexcept {}

  // The output of the last plan() or add_forces() that the physics must not take; of models from outside
  // alone.
  virtual std::optional<RefusedOutput> refused_output() const noexcept { return std::nullopt; }

  // Saves or restores the state of the model beyond the field. A model without this cannot be saved: it
  // throws common::UserError.
  virtual void archive(common::StateArchive&) {
    throw common::UserError("an actuator of this surface cannot be saved: its model has no archive()");
  }

  // Writes the state of the model's cells for drawing. rows × columns; see scene::ActuatorState.
  virtual void write_cell_motion(std::span<scene::ActuatorState>) const noexcept {}

  // True if the cells have joints, whose positions are sensed.
  virtual bool has_joints() const noexcept { return false; }
  // Writes the joint positions of the model's cells, u: scene::kMaxJoints × rows × columns.
  virtual void write_joint_positions(std::span<float>) const noexcept {}
};

}  // namespace smartsurf::surface
