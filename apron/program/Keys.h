// The keys that a program can read, by name and code.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace apron::program {

// Characters have their ASCII code in lower case, the others a code from 256.
inline constexpr int kLeftKey = 256, kUpKey = 257, kRightKey = 258, kDownKey = 259;

// The code of a key's name: a visible ASCII character, or left, up, right, down, space,
// enter, tab, escape, backspace. nullopt for another name.
std::optional<int> key_code(std::string_view name);
// One line that names the nearest key, or all.
std::string unknown_key_message(std::string_view name);

}  // namespace apron::program
