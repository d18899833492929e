// The static assets of the exported page, compiled into the program. Internal to this module.
#pragma once

#include <string_view>

namespace smartsurf::web {

std::string_view page_html();      // a template with {{NAME}} placeholders
std::string_view player_js();      // module; imports 'plots' and 'table'
std::string_view plots_js();       // module; imports 'table'
std::string_view table_js();       // module; imports 'three' and 'mechanisms'
std::string_view mechanisms_js();  // module; imports 'three'
std::string_view three_js();       // module: the parts of three.js that the pages use
std::string_view three_licence();

}  // namespace smartsurf::web
