// Maps characters and keys to actions. Internal to smartsurf/view.
#pragma once

#include <optional>

#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::view {

// The action of a typed character (Unicode). Characters, not key codes, so that the user's keyboard layout
// applies.
std::optional<UiAction> action_for_character(unsigned character);
// The action of a key without a character, by its GLFW code. repeated: auto-repeat of a held key, which only
// some bindings accept.
std::optional<UiAction> action_for_key_code(int code, bool repeated);

}  // namespace smartsurf::view
