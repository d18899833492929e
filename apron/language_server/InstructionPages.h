// The text that an editor shows of an instruction: its call, what it does, and its row of the language page.
#pragma once

#include <string>
#include <string_view>

namespace apron::language_server {

extern const char* const kLanguagePage;  // docs/apron-language.md

// Markdown; "" if there is no instruction, directive or keyword of that name.
std::string instruction_page(std::string_view name);

}  // namespace apron::language_server
