// Writes the parts of a recording that precede its first frame: /meta and /surface. Internal to this module.
#pragma once

#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

void write_meta(hid_t file, const RunMetadata& meta, const scene::SceneSpec& spec);
// Returns the group /surface.
Handle write_surface(hid_t file, const scene::SurfaceSpec& surface);

}  // namespace smartsurf::record
