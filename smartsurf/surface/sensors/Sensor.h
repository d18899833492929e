// Interface of a sensor model, which turns the state of the world into readings for all cells of the surface.
// CONTRIBUTING.md says how to add one to this tree, docs/extending.md how to add one as an extension.
//
// A sensor measures true values; SensorArray applies noise, faults and delays.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "common/state/StateArchive.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/raycast/RayCaster.h"

namespace smartsurf::surface {

// The state to sense at the end of a tick. Valid during sense() only.
struct SensorInput {
  const scene::Snapshot& snapshot;               // objects, and the heights of the cells
  std::span<const scene::ObjectSpec> catalogue;  // every object ever created, index = id
  const RayBodies& bodies;                       // the snapshot's objects, prepared for ray casts
  // Normal impulse on each cell during the tick: rows × columns, mass·u/s. Empty unless a sensor
  // needs_impulses().
  std::span<const float> impulse;
  // Impulse on each tip of a delta robot during the tick, friction included. Empty without such tips.
  std::span<const Eigen::Vector3f> tip_impulse;
  // Downward impulse on each node of the skin during the tick, mass·u/s. Empty without a skin.
  std::span<const float> skin_impulse;
  double period_s;  // duration of a tick
  bool restored =
      false;  // the state was restored: since the last sense(), any object of the catalogue may have changed
};

class Sensor {
 public:
  Sensor() = default;
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;
  virtual ~Sensor() = default;

  // Measures the input. Results must not depend on the number of threads. May allocate only when objects are
  // added.
  virtual void sense(const SensorInput&, common::ThreadPool&) = 0;

  // The values of a channel after the last sense(): components × rows × columns, one plane per component,
  // row-major, row 0 north, within the channel's range. The span stays valid for the sensor's lifetime.
  virtual std::span<const float> values(int channel) const noexcept = 0;

  // Saves or restores the state that does not follow from the latest snapshot. Called after a sense() with
  // that snapshot and without impulses.
  virtual void archive(common::StateArchive&) {}

  // True if sense() reads SensorInput::impulse, tip_impulse or skin_impulse.
  virtual bool needs_impulses() const noexcept { return false; }
};

// The ray that a sensor's `range`, `direction`, `origin` and `pins` describe.
CellRay cell_ray_of(const scene::SensorSpec&);

}  // namespace smartsurf::surface
