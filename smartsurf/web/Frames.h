// The recorded frames that an export shows.
#pragma once

#include <cstddef>
#include <vector>

#include "smartsurf/record/Recording.h"

namespace smartsurf::web {

// At most frames_per_second frames of each simulated second, the first and the last among them.
// Throws scene::InputError if the recording holds nothing to show.
std::vector<std::size_t> select_frames(const record::Recording& recording, double frames_per_second);

}  // namespace smartsurf::web
