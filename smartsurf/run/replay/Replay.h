// `smartsurf replay`: plays a recording in the window, or writes it as a video or pictures.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/video/VideoEncoder.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/run/options/RunOptions.h"

namespace smartsurf::run {

// Writes the video and the screenshots as the run itself would have. Throws scene::InputError if a time lies
// after the recording's end or a file cannot be written. Returns false if interrupted by `stop`.
bool replay_to_media(const record::Recording&, const std::vector<Screenshot>&,
                     std::unique_ptr<common::VideoEncoder> video, const RenderOptions&,
                     const std::atomic<bool>& stop);

// True if the cells are to be coloured by a sensor, and the recording has none.
bool needs_rerun(const record::Recording&, const RenderOptions&);
// The same as replay_to_media(), with sensors: runs the recorded experiment again, as verify() does. Throws
// scene::InputError, too, if it cannot be repeated.
bool rerun_to_media(const record::Recording&, const std::vector<Screenshot>&,
                    std::unique_ptr<common::VideoEncoder> video, const RenderOptions&,
                    const std::filesystem::path& output_folder, const std::atomic<bool>& stop);

// Plays the recording in a window until the user closes it or opens another file there, which is returned; it
// can be the same. pace: recorded seconds per wall second, > 0. Throws scene::InputError if there is no
// display, or the recording lacks what --cells or --plot name.
std::string replay_in_window(const record::Recording&, double pace, const view::ViewSettings&,
                             const std::atomic<bool>& stop);

}  // namespace smartsurf::run
