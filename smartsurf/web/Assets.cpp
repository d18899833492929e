#include "smartsurf/web/Assets.h"

// Embeds a file between two symbols.
#define ASSET(name, file)                                                                    \
  asm(".section .rodata\n"                                                                   \
      "smartsurf_asset_" #name                                                               \
      ":\n"                                                                                  \
      ".incbin \"" SMARTSURF_WEB_ASSETS "/" file                                             \
      "\"\n"                                                                                 \
      "smartsurf_asset_" #name                                                               \
      "_end:\n"                                                                              \
      ".byte 0\n"                                                                            \
      ".previous\n");                                                                        \
  extern "C" const char smartsurf_asset_##name[];                                            \
  extern "C" const char smartsurf_asset_##name##_end[];                                      \
  namespace smartsurf::web {                                                                 \
  std::string_view name() { return {smartsurf_asset_##name, smartsurf_asset_##name##_end}; } \
  }

ASSET(page_html, "page.html")
ASSET(player_js, "player.js")
ASSET(table_js, "table.js")
ASSET(plots_js, "plots.js")
ASSET(mechanisms_js, "mechanisms.js")
ASSET(three_js, "three/three.min.js")
ASSET(three_licence, "three/LICENSE")
