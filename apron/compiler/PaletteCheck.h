// Checks palette names in programs.
#pragma once

#include <string>
#include <string_view>

namespace apron::compiler {

// "" if the palette exists; otherwise the error message, with the nearest name or all names.
std::string palette_error(std::string_view name);

}  // namespace apron::compiler
