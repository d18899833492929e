// Reads /objects: the description and initial state of every object. Internal to this module.
#pragma once

#include "smartsurf/record/hdf5/Hdf5.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

// Adds the objects of the file, as far as a killed run got with them, and the names of their materials.
// Throws Hdf5Error for what no recorder wrote.
void read_catalogue(hid_t file, scene::SceneSpec& spec);

}  // namespace smartsurf::record
