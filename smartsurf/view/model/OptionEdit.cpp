#include "smartsurf/view/model/OptionEdit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/text/Number.h"

namespace smartsurf::view {
OptionEdit::OptionEdit(const scene::OptionSpec& option)
    : name(option.name), help(option.help), original(option.value), text(option.value) {
  long integer = 0;
  double real = 0.0;
  if (original == "true" || original == "false") {
    kind = Kind::kBool;
    checked = original == "true";
  } else if (common::parse_number(original, integer) && std::abs(integer) < (1 << 23)) {
    kind = Kind::kInteger;
    number = static_cast<float>(integer);
  } else if (common::parse_number(original, real) && std::isfinite(real)) {
    kind = Kind::kReal;
    number = static_cast<float>(real);
  }
  original_number_ = number;
  const float least = kind == Kind::kInteger ? 10.0F : 1.0F;
  low = std::min(0.0F, number < 0.0F ? 2.0F * number : 0.0F);
  high = number > 0.0F ? 2.0F * number : number == 0.0F ? least : 0.0F;
  if (kind == Kind::kInteger && number > 0.0F) high = std::max(high, least);
}

std::string OptionEdit::value() const {
  char digits[32];
  switch (kind) {
    case Kind::kBool:
      return checked ? "true" : "false";
    case Kind::kText:
      return text;
    default:
      if (number == original_number_) return original;
      std::snprintf(digits, sizeof digits, kind == Kind::kInteger ? "%.0f" : "%.6g",
                    static_cast<double>(number));
      return digits;
  }
}

std::vector<OptionEdit> make_option_edits(const std::vector<scene::OptionSpec>& options) {
  std::vector<OptionEdit> edits;
  for (const scene::OptionSpec& option : options) edits.emplace_back(option);
  return edits;
}

std::vector<NamedValue> changed_options(const std::vector<OptionEdit>& edits) {
  std::vector<NamedValue> values;
  for (const OptionEdit& edit : edits)
    if (edit.changed()) values.push_back({edit.name, edit.value()});
  return values;
}

}  // namespace smartsurf::view
