// One model of an actuator, for all cells of the surface that have it: targets in, motion of the cells and
// forces on the objects out. docs/extending.md adds one.
//
// Of every physics step: plan(), forces() where there are any, the physics, commit(). No call but the
// constructor allocates or throws. A model reads and writes its own cells' entries of the field only.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/actuators/BodyForces.h"

namespace smartsurf::surface {

// Neighbouring cells [begin, end) of one row.
struct CellRun {
  int begin = 0, end = 0;
};

// Where a model stands. The field has its shape, and its heights are those of the base, when a model is made.
struct ActuatorContext {
  const scene::SurfaceSpec& surface;
  const scene::ActuatorSpec& spec;
  std::vector<CellRun> runs;  // the model's cells, ascending; none is of the border
  const Field& field;
  common::ThreadPool* pool = nullptr;  // for work on many cells; null: the caller does all of it
};

class Actuator {
 public:
  Actuator() = default;
  Actuator(const Actuator&) = delete;
  Actuator& operator=(const Actuator&) = delete;
  virtual ~Actuator() = default;

  // What the cells aim at from now on. targets: rows × columns, row-major, row 0 north; the model's own cells
  // are within the channel's range, what the others hold means nothing. Channels count as in the kind's list.
  virtual void set_targets(int channel, std::span<const float> targets) noexcept = 0;

  // Takes the cells to their targets at once, before the first step.
  virtual void snap_to_targets(Field&) noexcept = 0;

  // Writes speed, drag and spin of the step to come, and raises max_height and max_speed to its own.
  virtual void plan(double dt_s, Field&) noexcept = 0;
  // Moves the tops by that speed. A model whose tops stay where they are has nothing to do.
  virtual void commit(double /*dt_s*/, Field&) noexcept {}

  // Whether any cell drags what lies on it: then the field has drag and spin.
  virtual bool has_surface_velocity() const noexcept { return false; }

  // Whether its cells bear a limited force: then the field has force_limit, which plan() writes.
  virtual bool has_force_limit() const noexcept { return false; }

  // Adds the forces of the step to come. catalogue[id] describes the object `id`; one wrench a body.
  virtual bool exerts_forces() const noexcept { return false; }
  virtual void add_forces(double /*dt_s*/, const Field&, const BodyView&,
                          std::span<const scene::ObjectSpec> /*catalogue*/, std::span<Wrench>) noexcept {}

  // For the eye: what its cells look like now. rows × columns; see scene::CellMotion.
  virtual void write_cell_motion(std::span<scene::ActuatorState>) const noexcept {}
};

using ActuatorFactory = std::function<std::unique_ptr<Actuator>(const ActuatorContext&)>;

// Makes the model known to scripts, to the protocol and to every surface made from now on, under the kind's
// name; one of that name is replaced. Before any experiment is loaded; not thread-safe.
void register_actuator(scene::ActuatorKind kind, ActuatorFactory make);

// The model of place.spec. Throws scene::InputError where there is none of that name.
std::unique_ptr<Actuator> make_actuator(const ActuatorContext& context);

}  // namespace smartsurf::surface
