#include "smartsurf/web/Frames.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::web {

std::vector<std::size_t> select_frames(const record::Recording& recording, double frames_per_second) {
  recording.require_poses();
  std::vector<std::size_t> selected;
  double next_s = -std::numeric_limits<double>::infinity();
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const double now_s = recording.times()[frame];
    if (now_s < next_s - 1e-6 && frame + 1 < recording.frames()) continue;
    selected.push_back(frame);
    next_s = std::isfinite(next_s) ? std::max(next_s + 1.0 / frames_per_second, now_s)
                                   : now_s + 1.0 / frames_per_second;
  }
  return selected;
}

}  // namespace smartsurf::web
