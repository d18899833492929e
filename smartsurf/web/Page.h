// `smartsurf export`: a recording as one self-contained web page that plays it in 3-D.
#pragma once

#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::web {

struct PageOptions {
  double frames_per_second = 30.0;  // recorded seconds; at most what was recorded
};

// The file appears whole or not at all. Throws scene::InputError when it cannot be written, when the
// recording holds nothing to show, or when the page would be too large for a browser.
void write_page(const record::Recording& recording, const std::filesystem::path& path,
                const PageOptions& options = {});

}  // namespace smartsurf::web
