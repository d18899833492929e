// Checks palette names in programs.
#pragma once

#include <string>
#include <string_view>

namespace apron::compiler {

// "" if there is a palette of that name; else the error's text, with the nearest name or all of them.
std::string palette_error(std::string_view name);

}  // namespace apron::compiler
