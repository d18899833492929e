// The static files of the exported page, compiled into the program. Internal to this module.
#pragma once

#include <string_view>

namespace smartsurf::web {

std::string_view page_html();          // with {{NAME}} where the rest goes
std::string_view player_js();          // a module that imports 'three', 'three/orbit' and 'mechanisms'
std::string_view mechanisms_js();      // a module that imports 'three'
std::string_view three_js();           // three.js, a module
std::string_view orbit_controls_js();  // a module that imports 'three'
std::string_view three_licence();

}  // namespace smartsurf::web
