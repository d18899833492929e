#include "smartsurf/scene/Variation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/text/Number.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {
namespace {

constexpr std::array<std::string_view, 3> kModeNames{"absolute", "factor", "offset"};

}  // namespace

std::string_view name_of(Variation::Mode mode) { return kModeNames[static_cast<std::size_t>(mode)]; }

std::optional<Variation::Mode> find_variation_mode(std::string_view name) {
  const auto* const found = std::ranges::find(kModeNames, name);
  if (found == kModeNames.end()) return std::nullopt;
  return static_cast<Variation::Mode>(found - kModeNames.begin());
}

std::string to_text(const Variation& v) {
  std::string text = common::shortest(v.low);
  if (v.high != v.low) text += ":" + common::shortest(v.high);
  if (v.mode != Variation::Mode::kAbsolute) text += ":" + std::string(name_of(v.mode));
  return text;
}

Variation parse_variation(std::string name, std::string_view text, std::string subject) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0;;) {
    const std::size_t colon = text.find(':', begin);
    parts.push_back(text.substr(begin, colon - begin));
    if (colon == std::string_view::npos) break;
    begin = colon + 1;
  }
  Variation v{.name = std::move(name), .subject = std::move(subject)};
  if (const auto mode = find_variation_mode(parts.back()); mode && parts.size() > 1) {
    v.mode = *mode;
    parts.pop_back();
  }
  if (!common::parse_number(parts.front(), v.low) || !common::parse_number(parts.back(), v.high) ||
      parts.size() > 2)
    throw InputError(v.subject + ": must be VALUE or LOW:HIGH, with or without :factor or :offset");
  if (const std::string clause = validate(v); !clause.empty()) throw InputError(v.subject + ": " + clause);
  return v;
}

std::string validate(const Variation& v) {
  for (const double end : {v.low, v.high})
    if (!std::isfinite(end)) return format_number(end) + ": must be a finite number";
  if (v.low > v.high) return "low = " + format_number(v.low) + " is above high = " + format_number(v.high);
  return "";
}

}  // namespace smartsurf::scene
