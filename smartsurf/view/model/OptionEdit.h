// Editing of one experiment option: a slider for a number, a switch for a boolean, a field for text.
// Independent of windows.
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

  // The kind follows from the option's text; a number's slider goes to twice its value.
  explicit OptionEdit(const scene::OptionSpec& option);

  // As --set takes it; the option's own text while nothing was changed.
  std::string value() const;
  bool changed() const { return value() != original; }

  std::string name, help, original;
  Kind kind = Kind::kText;
  float number = 0.0F, low = 0.0F, high = 1.0F;  // kInteger, kReal
  bool checked = false;                          // kSwitch
  std::string text;                              // kText

 private:
  float original_number_ = 0.0F;
};

std::vector<OptionEdit> make_option_edits(const std::vector<scene::OptionSpec>& options);
// Those that were changed.
std::vector<NamedValue> changed_options(const std::vector<OptionEdit>& edits);

}  // namespace smartsurf::view
