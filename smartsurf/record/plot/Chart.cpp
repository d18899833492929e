#include "smartsurf/record/plot/Chart.h"

#include <cmath>
#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {

std::string subtitle(const Recording& recording) {
  std::string text = std::filesystem::path(recording.spec().file).filename().string();
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : " · ") + part; };
  if (recording.meta().is_simulated) add("seed " + std::to_string(recording.spec().world.seed));
  if (recording.frames() == 0) return text;
  const auto rounded = [](double t) { return format_number(std::round(t * 10.0) / 10.0); };
  add(rounded(recording.times().front()) + " to " + rounded(recording.times().back()) + " s");
  return text;
}

}  // namespace smartsurf::record
