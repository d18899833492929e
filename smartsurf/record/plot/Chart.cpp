#include "smartsurf/record/plot/Chart.h"

#include <filesystem>

#include "smartsurf/record/Recording.h"
#include "smartsurf/record/TimeText.h"

namespace smartsurf::record {

std::string subtitle(const Recording& recording) {
  std::string text = std::filesystem::path(recording.spec().file).filename().string();
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : " · ") + part; };
  if (recording.meta().is_simulated) add("seed " + std::to_string(recording.spec().world.seed));
  if (recording.frames() == 0) return text;
  add(time_text(recording.times().front()) + " to " + time_text(recording.times().back()) + " s");
  return text;
}

}  // namespace smartsurf::record
