// One model of a sensor, for all cells of the surface: a moment in, readings out. docs/extending.md adds one.
//
// A sensor tells the truth; what real ones make of it (noise, faults, delays) is SensorArray's.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/raycast/RayCaster.h"

namespace smartsurf::surface {

// What there is to sense, at the end of a tick.
struct SensorInput {
  const scene::Snapshot& snapshot;               // objects, and the heights of the cells
  std::span<const scene::ObjectSpec> catalogue;  // every object ever created, index = id
  const RayBodies& bodies;                       // the snapshot's objects as segments meet them
  // rows × columns: normal impulse on each cell in the tick that ended, mass·u/s. Empty unless a sensor
  // feels().
  std::span<const float> impulse;
  double period_s;  // of a tick
};

class Sensor {
 public:
  Sensor() = default;
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;
  virtual ~Sensor() = default;

  // Measures. Results must not depend on the number of threads. Allocates only when there are more objects
  // than ever before.
  virtual void sense(const SensorInput&, common::ThreadPool&) = 0;

  // The readings of its n-th channel after the last sense(): components × rows × columns, each component a
  // whole plane, row 0 north, within the channel's range. The memory stays the same for the sensor's life.
  virtual std::span<const float> values(int channel) const noexcept = 0;

  // Whether it reads Moment::impulse.
  virtual bool needs_impulses() const noexcept { return false; }
};

// field: where the cells stand; kept by nobody.
using SensorFactory = std::function<std::unique_ptr<Sensor>(const Field& field, const scene::SensorSpec&)>;

// Makes the model known to scripts, to the protocol and to every surface made from now on, under the kind's
// name; one of that name is replaced. Before any experiment is loaded; not thread-safe.
void register_sensor(scene::SensorKind kind, SensorFactory make);

// Throws scene::InputError where there is no model of that name.
std::unique_ptr<Sensor> make_sensor(const Field&, const scene::SensorSpec&);

// What `range`, `direction`, `origin` and `pins` of a sensor say.
CellRay cell_ray_of(const scene::SensorSpec&);

}  // namespace smartsurf::surface
