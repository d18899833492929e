// Key bindings. Internal to this module.
#pragma once

#include <optional>

#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::view {

// Of a character that was typed, so that the keys are where the user's keyboard has them.
std::optional<UiAction> action_for_character(unsigned character);
// Of a key without a character, by GLFW's code; held keys repeat where that makes sense.
std::optional<UiAction> action_for_key_code(int code, bool repeated);

}  // namespace smartsurf::view
