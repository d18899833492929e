#include "smartsurf/run/Flags.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {

double positive_number(const std::string& flag, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !(value > 0.0 && value <= 1e9))
    throw scene::InputError(fmt::format("{} {}: must be a number greater than 0, at most 1e9", flag, text));
  return value;
}

Screenshot screenshot_of(const std::string& text) {
  const auto at = text.rfind('@');
  Screenshot shot{text.substr(0, at), std::nullopt};
  if (at != std::string::npos) {
    double seconds = 0.0;
    const std::string number = text.substr(at + 1);
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), seconds);
    if (error != std::errc{} || end != number.data() + number.size() || !std::isfinite(seconds) ||
        seconds < 0.0)
      throw scene::InputError(
          fmt::format("--screenshot {}: '{}' must be a time in seconds, as in before.png@0.5", text, number));
    shot.at_s = seconds;
  }
  if (!shot.file.ends_with(".png"))
    throw scene::InputError(fmt::format("--screenshot {}: the file's name must end in .png", text));
  return shot;
}

std::vector<std::pair<std::string, std::string>> pairs_of(const std::vector<std::string>& settings) {
  std::vector<std::pair<std::string, std::string>> pairs;
  for (const auto& text : settings) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw scene::InputError(fmt::format("--set {}: must be NAME=VALUE", text));
    pairs.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  return pairs;
}

void reject_both(bool both, const char* flags) {
  if (both) throw scene::InputError(fmt::format("{}: choose one", flags));
}

}  // namespace smartsurf::run
