// Units of measurement as readers see them.
#pragma once

#include <string>
#include <string_view>

namespace common {

// "mass·u/s²" for "mass*u/s^2", as channels and recordings spell it in ASCII.
inline std::string typeset_unit(std::string_view unit) {
  std::string text;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const bool is_power = unit[i] == '^' && i + 1 < unit.size() && (unit[i + 1] == '2' || unit[i + 1] == '3');
    if (is_power)
      text += unit[++i] == '2' ? "²" : "³";
    else if (unit[i] == '*')
      text += "·";
    else
      text += unit[i];
  }
  return text;
}

// "name [unit]", or the name where there is no unit.
inline std::string with_unit(const std::string& name, std::string_view unit) {
  return unit.empty() ? name : name + " [" + typeset_unit(unit) + "]";
}

}  // namespace common
