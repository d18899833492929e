// The edit state of one experiment option: a slider for a number, a checkbox for a boolean, a field for text.
// Independent of the window system.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {

struct NamedValue {
  std::string name, value;
};

struct OptionEdit {
  enum class Kind { kInteger, kReal, kBool, kText };

  // The kind is derived from the option's text. A number's slider extends to twice its value.
  explicit OptionEdit(const scene::OptionSpec& option);

  // The value as --set accepts it; the original text while unchanged.
  std::string value() const;
  bool changed() const { return value() != original; }

  std::string name, help, original;
  Kind kind = Kind::kText;
  float number = 0.0F, low = 0.0F, high = 1.0F;  // kInteger, kReal
  bool checked = false;                          // kBool
  std::string text;                              // kText

 private:
  float original_number_ = 0.0F;
};

std::vector<OptionEdit> make_option_edits(const std::vector<scene::OptionSpec>& options);
// The options whose value differs from the original.
std::vector<NamedValue> changed_options(const std::vector<OptionEdit>& edits);

}  // namespace smartsurf::view
