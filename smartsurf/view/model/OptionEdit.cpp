#include "smartsurf/view/model/OptionEdit.h"

#include <algorithm>
#include <cmath>

#include "common/text/Number.h"

namespace smartsurf::view {
namespace {

template <class Number>
Number number_or_zero(const std::string& text) {
  Number number{};
  return common::parse_number(text, number) ? number : Number{};
}

}  // namespace

OptionEdit::OptionEdit(const scene::OptionSpec& option)
    : spec(option),
      integer(number_or_zero<std::int64_t>(option.value)),
      real(number_or_zero<double>(option.value)),
      checked(option.value == "true"),
      text(option.value) {}

std::string OptionEdit::value() const {
  switch (spec.kind) {
    case Kind::kBool:
      return checked ? "true" : "false";
    case Kind::kText:
      return text;
    case Kind::kInteger:
      return std::to_string(integer);
    case Kind::kReal:
      break;
  }
  return real == number_or_zero<double>(spec.value) ? spec.value : common::shortest(real);
}

std::optional<std::array<std::int64_t, 2>> OptionEdit::integer_range() const {
  if (!spec.range) return std::nullopt;
  static constexpr double kLargest = 0x1p62;
  const auto whole = [](double end) {
    return static_cast<std::int64_t>(std::clamp(end, -kLargest, kLargest));
  };
  return std::array{whole(std::ceil((*spec.range)[0])), whole(std::floor((*spec.range)[1]))};
}

std::vector<OptionEdit> make_option_edits(const std::vector<scene::OptionSpec>& options) {
  return {options.begin(), options.end()};
}

std::vector<NamedValue> changed_options(const std::vector<OptionEdit>& edits) {
  std::vector<NamedValue> values;
  for (const OptionEdit& edit : edits)
    if (edit.changed()) values.push_back({edit.spec.name, edit.value()});
  return values;
}

}  // namespace smartsurf::view
