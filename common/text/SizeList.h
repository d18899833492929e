// The sizes of a window's parts as text: a line "NAME POINTS" for each that the user has chosen.
//
// for_each(visit) calls visit(name, size), with a float& to parse; 0 is a size that the user has not chosen.
#pragma once

#include <cmath>
#include <sstream>
#include <string>
#include <string_view>

namespace common {

template <class ForEach>
std::string format_size_list(const ForEach& for_each) {
  std::ostringstream text;
  for_each([&](std::string_view name, float size) {
    if (size > 0.0F) text << name << ' ' << std::lround(size) << '\n';
  });
  return text.str();
}

// Leaves out lines with unknown names or sizes that no screen has.
template <class ForEach>
void parse_size_list(std::string_view text, const ForEach& for_each) {
  constexpr float kMaxPoints = 10'000.0F;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string known;
    float points = 0.0F;
    if (!(words >> known >> points) || !(points >= 0.0F && points <= kMaxPoints)) continue;
    for_each([&](std::string_view name, float& size) {
      if (name == known) size = points;
    });
  }
}

}  // namespace common
