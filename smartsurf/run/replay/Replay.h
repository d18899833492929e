// `smartsurf replay`: plays a recording in the window, or writes it as a video or pictures.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"
#include "smartsurf/run/cli/RunOptions.h"

namespace smartsurf::run {

// Writes the video and the screenshots as the run itself would have. Throws scene::InputError if a time lies
// after the recording's end or a file cannot be written. Returns false if interrupted by `stop`.
bool replay_to_media(const record::Recording&, const std::vector<Screenshot>&, const std::string& video_file,
                     const RenderOptions&, const std::atomic<bool>& stop);

// Plays the recording in a window until the user closes it. pace: recorded seconds per wall second, > 0.
void replay_in_window(const record::Recording&, double pace, const std::atomic<bool>& stop);

}  // namespace smartsurf::run
