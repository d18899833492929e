// Exports a recording as a self-contained web page that plays it in 3-D (`smartsurf export`).
#pragma once

#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::web {

struct PageOptions {
  double frames_per_second = 30.0;  // per simulated second; limited by the recording
};

// Replaces the file atomically. Throws scene::InputError if the file cannot be written, the recording has
// nothing to show, or the page would be too large for a browser.
void write_page(const record::Recording& recording, const std::filesystem::path& path,
                const PageOptions& options = {});

}  // namespace smartsurf::web
