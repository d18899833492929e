// Draws the window's panels with Dear ImGui. Internal to this module.
//
// Call between ImGui::NewFrame and ImGui::Render.
#pragma once

#include <imgui.h>

#include <string>

#include "apron/ui/Gui.h"
#include "apron/ui/ViewModel.h"
#include "apron/ui/panels/TextureCache.h"

namespace apron::ui {

inline ImVec2 operator+(ImVec2 a, ImVec2 b) { return {a.x + b.x, a.y + b.y}; }

// Shows the text while the mouse is over the last item.
inline void draw_tooltip(const char* text, ImGuiHoveredFlags flags = ImGuiHoveredFlags_None) {
  if (ImGui::IsItemHovered(flags)) ImGui::SetTooltip("%s", text);
}

struct DrawContext {
  ViewModel& model;
  TextureCache& textures;
  const Gui& gui;

  float to_pixels(float points) const { return points * gui.scale(); }
};

// True if the window is wide enough for three columns.
bool is_wide_layout(const DrawContext& context);
// Draws the whole window at the display's size.
void draw_window(DrawContext& context);
// Handles keyboard shortcuts, unless a text field has the focus.
void handle_keys(ViewModel& model);

void draw_toolbar(DrawContext& context);
void draw_register_list(DrawContext& context);
void draw_register_view(DrawContext& context);
void draw_tiles(DrawContext& context);
void draw_program(DrawContext& context);
// Replaces draw_program() while ProgramEditor::shown. Requires ProgramEditor::current().
void draw_editor(DrawContext& context);
void draw_values_panel(DrawContext& context);
void draw_console_panel(DrawContext& context);
void draw_probe_panel(DrawContext& context);
void draw_breakpoint_panel(DrawContext& context);
void draw_help(DrawContext& context);

// The title that the program gave the register, or its name.
std::string register_title(const ViewModel& model, std::size_t reg);
// Draws the text, clipped to the width.
void draw_fitted_text(ImDrawList& list, ImVec2 at, float width, ImU32 colour, const std::string& text);
// Draws the register centred in the available area, as large as fits.
void draw_register_image(DrawContext& context, ImVec2 corner, ImVec2 available,
                         const debugger::SampledRegister& sample, TextureSlot slot);
// Draws the cells of a register whose north-west corner is at `origin`, a cell `cell_edge` pixels wide;
// hexagons only within the visible rectangle.
void draw_cells(DrawContext& context, ImVec2 origin, float cell_edge, ImVec2 visible_corner,
                ImVec2 visible_end, const debugger::SampledRegister& sample, TextureSlot slot);
// The sample of the register, or nullptr.
const debugger::SampledRegister* find_sample(const std::vector<debugger::SampledRegister>& samples,
                                             std::size_t reg);

// At most six significant digits: "0.25", "1e-07", "12345.7".
std::string format_short(double value);

}  // namespace apron::ui
