// Opens the file of a recording: HDF5 (.h5, .hdf5) or CSV (.csv); docs/recordings.md describes both.
#pragma once

#include <filesystem>
#include <memory>

#include "common/files/PreparedOutputs.h"
#include "smartsurf/record/Recorder.h"

namespace smartsurf::record {

// Creates the file that a recording of that name is written to, for a process that may not do so later.
// Throws as open_recorder().
common::PreparedOutput prepare_recording(const std::filesystem::path& path);

// Throws scene::InputError if the path is unusable (extension, directory, permission, a file that another run
// is writing).
std::unique_ptr<Recorder> open_recorder(const std::filesystem::path& path, const RunMetadata& meta,
                                        const scene::SceneSpec& spec);

}  // namespace smartsurf::record
