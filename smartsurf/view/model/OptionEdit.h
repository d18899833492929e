// The edit state of one experiment option: a slider or a field for a number, a checkbox for a boolean, a list
// or a field for a text. Independent of the window system.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {

struct NamedValue {
  std::string name, value;
};

struct OptionEdit {
  using Kind = scene::OptionSpec::Kind;

  explicit OptionEdit(const scene::OptionSpec& option);

  // The value as --set accepts it; the original text while unchanged.
  std::string value() const;
  bool changed() const { return value() != spec.value; }

  scene::OptionSpec spec;    // its kind says which of the next is edited
  std::int64_t integer = 0;  // kInteger
  double real = 0.0;         // kReal
  bool checked = false;      // kBool
  std::string text;          // kText

  // The whole numbers in the range of a kInteger that has one, at most 2⁶² in size.
  std::optional<std::array<std::int64_t, 2>> integer_range() const;
};

std::vector<OptionEdit> make_option_edits(const std::vector<scene::OptionSpec>& options);
// The options whose value differs from the original.
std::vector<NamedValue> changed_options(const std::vector<OptionEdit>& edits);

}  // namespace smartsurf::view
