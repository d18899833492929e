// Writes and reads the cell layout and actuators of a surface: `place`, `base` and `cell` of the group
// /surface, each only if not the default, and `mechanisms`. Internal to this module; throws Hdf5Error.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::record {

void write_layout(hid_t surface_group, const scene::SurfaceSpec&);
// Fills in what the group holds; older recordings have none of it. Requires surface.rows and surface.columns.
void read_layout(hid_t surface_group, scene::SurfaceSpec& surface);

// Conversion of actuator states to the rows of /surface/motion: a, b and level of each cell.
inline constexpr std::size_t kValuesPerActuatorState = 3;
void flatten_actuator_state(std::span<const scene::ActuatorState> motion, std::vector<float>& flat);
std::vector<scene::ActuatorState> unflatten_actuator_state(std::span<const float> flat);

}  // namespace smartsurf::record
