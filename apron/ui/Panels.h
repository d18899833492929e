// The parts of the window, in Dear ImGui: between ImGui::NewFrame and ImGui::Render. Internal to the room.
#pragma once

#include <imgui.h>

#include <string>

#include "apron/ui/Gui.h"
#include "apron/ui/Textures.h"
#include "apron/ui/Workbench.h"

namespace apron::ui {

struct Stage {
  Workbench& bench;
  Textures& textures;
  const Gui& gui;

  float px(float points) const { return points * gui.scale(); }
};

// Whether there is room for three columns.
bool is_wide(const Stage& stage);
// All of the window, as large as the display.
void draw_window(Stage& stage);
// Space, arrows and letters, unless the person is typing.
void take_keys(Workbench& bench);

void draw_controls(Stage& stage);
void draw_registers(Stage& stage);
void draw_large(Stage& stage);
void draw_tiles(Stage& stage);
void draw_program(Stage& stage);
void draw_values(Stage& stage);
void draw_console(Stage& stage);
void draw_cell(Stage& stage);
void draw_breakpoints(Stage& stage);
void draw_help(Stage& stage);

// What the program calls a register that it shows, or its name.
std::string title(const Workbench& bench, std::size_t reg);
// The text as far as it fits.
void fitted_text(ImDrawList& list, ImVec2 at, float width, ImU32 colour, const std::string& text);
// A shot in the middle of its place, as large as fits.
void draw_shot(Stage& stage, ImVec2 corner, ImVec2 room, const debugger::Shot& shot, ShotUse use);
// Of that register, or nullptr.
const debugger::Shot* find_shot(const std::vector<debugger::Shot>& shots, std::size_t reg);

// "0.25", "1e-07", "12345.7": at most six digits.
std::string short_number(double value);

}  // namespace apron::ui
