// Exports a recording as an animated binary glTF 2.0 file (.glb), which Blender, slide programs, web viewers
// and engines open
// (`smartsurf export`).
#pragma once

#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::web {

struct GltfOptions {
  double frames_per_second = 30.0;  // per simulated second; limited by the recording
};

// Replaces the file atomically. One node for each object, pin and part of an actuator, in a node "table" that
// turns z up into glTF's y up; 1 u is 1 m. The animation "run" starts at the first recorded frame. Key frames
// that the linear interpolation of their neighbours gives are left out: positions are exact to 0.001 u, pins
// to 0.002 u, rotations to 0.4°. An object that does not exist has a scale of 0. A skin has its form of
// the first frame. `extras` has the numbers of the recorded frames that are shown, and their times. Throws
// scene::InputError if the file cannot be written, the recording has nothing to show, or the file would be
// larger than glTF allows.
void write_gltf(const record::Recording& recording, const std::filesystem::path& path,
                const GltfOptions& options = {});

}  // namespace smartsurf::web
