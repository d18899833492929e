// The parts of a recording that precede its first frame, /meta and /surface, and the result. Internal to this
// module; throws Hdf5Error.
#pragma once

#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

void write_meta(hid_t file, const RunMetadata& meta, const scene::SceneSpec& spec);
void write_surface(hid_t file, const scene::SurfaceSpec& surface);
void write_result(hid_t file, const RunResult& result);

struct RecordedMeta {
  RunMetadata meta;
  std::optional<RunResult> result;                      // nullopt if the run did not finish
  std::optional<std::uint64_t> first_interaction_tick;  // see Recording
};
// Fills in the file, source, options, world and record of `spec`. Refuses what is not a recording of this
// format.
RecordedMeta read_meta(hid_t file, scene::SceneSpec& spec);
// Returns the models of its actuators, separated by commas.
std::string read_surface(hid_t file, scene::SurfaceSpec& surface);

}  // namespace smartsurf::record
