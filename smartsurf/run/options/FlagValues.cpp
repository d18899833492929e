#include "smartsurf/run/options/FlagValues.h"

#include <fmt/format.h>

#include <cmath>

#include "common/text/Number.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {

double parse_positive_number(const std::string& flag, const std::string& text) {
  double value = 0.0;
  if (!common::parse_number(text, value) || !(value > 0.0 && value <= 1e9))
    throw scene::InputError(fmt::format("{} {}: must be a number greater than 0, at most 1e9", flag, text));
  return value;
}

Screenshot parse_screenshot(const std::string& text) {
  const auto separator = text.rfind('@');
  Screenshot screenshot{text.substr(0, separator), std::nullopt};
  if (separator != std::string::npos) {
    double seconds = 0.0;
    const std::string seconds_text = text.substr(separator + 1);
    if (!common::parse_number(seconds_text, seconds) || !std::isfinite(seconds) || seconds < 0.0)
      throw scene::InputError(fmt::format(
          "--screenshot {}: '{}' must be a time in seconds, as in before.png@0.5", text, seconds_text));
    screenshot.time_s = seconds;
  }
  if (!screenshot.file.ends_with(".png"))
    throw scene::InputError(fmt::format("--screenshot {}: the file's name must end in .png", text));
  return screenshot;
}

scene::Overrides parse_overrides(const std::vector<std::string>& set, const std::vector<std::string>& vary) {
  scene::Overrides pairs;
  const auto add = [&](const std::string& flag, const std::string& form, const std::string& prefix,
                       const std::string& assignment) {
    const auto equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0)
      throw scene::InputError(fmt::format("{} {}: must be {}", flag, assignment, form));
    pairs.emplace_back(prefix + assignment.substr(0, equals), assignment.substr(equals + 1));
  };
  for (const std::string& assignment : set) add("--set", "NAME=VALUE", "", assignment);
  for (const std::string& assignment : vary) add("--vary", "NAME=LOW:HIGH[:MODE]", "vary.", assignment);
  return pairs;
}

void reject_both(bool both_given, const char* flags) {
  if (both_given) throw scene::InputError(fmt::format("{}: choose one", flags));
}

}  // namespace smartsurf::run
