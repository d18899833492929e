// Reads /objects: the description and initial state of every object. Internal to this module.
#pragma once

#include "smartsurf/record/hdf5/Hdf5.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

// Appends the file's objects to spec.objects and their materials, by name only, to spec.materials. Objects
// that a killed run stored incompletely are omitted. Throws Hdf5Error for data that no recorder writes.
void read_catalogue(hid_t file, scene::SceneSpec& spec);

}  // namespace smartsurf::record
