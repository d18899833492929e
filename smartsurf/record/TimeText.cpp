#include "smartsurf/record/TimeText.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace smartsurf::record {

std::string time_text(double time_s) {
  const double digits = time_s > 0.0 ? 3.0 - std::floor(std::log10(time_s)) : 1.0;
  char text[400];  // up to 1e308
  std::snprintf(text, sizeof text, "%.*f", static_cast<int>(std::clamp(digits, 1.0, 20.0)), time_s);
  std::string result = text;
  result.erase(result.find_last_not_of('0') + 1);
  if (result.ends_with('.')) result.pop_back();
  return result;
}

}  // namespace smartsurf::record
