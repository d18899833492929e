// The panels of the window, in Dear ImGui: called between ImGui::NewFrame and ImGui::Render. Internal to this
// module.
#pragma once

#include <imgui.h>

#include <string>

#include "apron/ui/ViewModel.h"
#include "apron/ui/panels/TextureCache.h"
#include "apron/ui/window/Gui.h"

namespace apron::ui {

struct DrawContext {
  ViewModel& model;
  TextureCache& textures;
  const Gui& gui;

  float to_pixels(float points) const { return points * gui.scale(); }
};

// Whether there is room for three columns.
bool is_wide_layout(const DrawContext& context);
// All of the window, as large as the display.
void draw_window(DrawContext& context);
// Space, arrows and letters, unless the person is typing.
void handle_keys(ViewModel& model);

void draw_toolbar(DrawContext& context);
void draw_register_list(DrawContext& context);
void draw_register_view(DrawContext& context);
void draw_tiles(DrawContext& context);
void draw_program(DrawContext& context);
void draw_values_panel(DrawContext& context);
void draw_console_panel(DrawContext& context);
void draw_probe_panel(DrawContext& context);
void draw_breakpoint_panel(DrawContext& context);
void draw_help(DrawContext& context);

// What the program calls a register that it shows, or its name.
std::string register_title(const ViewModel& model, std::size_t reg);
// The text as far as it fits.
void draw_fitted_text(ImDrawList& list, ImVec2 at, float width, ImU32 colour, const std::string& text);
// A shot in the middle of its place, as large as fits.
void draw_register_image(DrawContext& context, ImVec2 corner, ImVec2 available,
                         const debugger::SampledRegister& sample, TextureSlot slot);
// Of that register, or nullptr.
const debugger::SampledRegister* find_sample(const std::vector<debugger::SampledRegister>& samples,
                                             std::size_t reg);

// "0.25", "1e-07", "12345.7": at most six digits.
std::string format_short(double value);

}  // namespace apron::ui
