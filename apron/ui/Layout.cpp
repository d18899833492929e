// Where the parts of the window are.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

constexpr ImGuiWindowFlags kFixed = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                                    ImGuiWindowFlags_NoSavedSettings |
                                    ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav;

// Points, from which on the program has a column of its own.
constexpr float kWide = 1200.0F;

struct Sizes {
  float list = 0.0F, program = 0.0F, bottom = 0.0F, values = 0.0F;  // program 0: it is one of the tabs
};

Sizes sizes(const Stage& stage, ImVec2 room) {
  Sizes s;
  const bool wide = is_wide(stage);
  s.list = wide ? std::clamp(room.x * 0.175F, stage.px(292), stage.px(420))
                : std::clamp(room.x * 0.24F, stage.px(176), stage.px(292));
  s.program = wide ? std::clamp(room.x * 0.37F, stage.px(400), stage.px(680)) : 0.0F;
  s.bottom = wide ? std::clamp(room.y * 0.28F, stage.px(190), stage.px(320)) : room.y * 0.38F;
  s.values = wide ? stage.px(300) : std::clamp(room.x * 0.2F, stage.px(176), stage.px(300));
  return s;
}

void part(const char* name, ImVec2 size, Stage& stage, void (*draw)(Stage&)) {
  ImGui::BeginChild(name, size, true, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse);
  draw(stage);
  ImGui::EndChild();
}

void tab(const char* name, Stage& stage, void (*draw)(Stage&), bool* shown = nullptr) {
  const bool open = ImGui::BeginTabItem(name);
  if (shown != nullptr) *shown = open;
  if (!open) return;
  draw(stage);
  ImGui::EndTabItem();
}

void draw_tabs(Stage& stage, bool with_program) {
  if (!ImGui::BeginTabBar("tabs")) return;
  if (with_program) tab("Program", stage, draw_program);
  tab("Console", stage, draw_console);
  tab("Cell", stage, draw_cell, &stage.bench.cell_shown);
  tab("Breakpoints", stage, draw_breakpoints);
  ImGui::EndTabBar();
}

void draw_bottom(Stage& stage, const Sizes& s) {
  part("values", {s.values, 0.0F}, stage, draw_values);
  ImGui::SameLine();
  ImGui::BeginChild("tabs", {0.0F, 0.0F}, true);
  draw_tabs(stage, s.program == 0.0F);
  ImGui::EndChild();
}

}  // namespace

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

bool is_wide(const Stage& stage) { return ImGui::GetIO().DisplaySize.x >= stage.px(kWide); }

void draw_window(Stage& stage) {
  take_keys(stage.bench);
  const ImVec2 room = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({0.0F, 0.0F});
  ImGui::SetNextWindowSize(room);
  ImGui::Begin("apron", nullptr, kFixed);
  const Sizes s = sizes(stage, room);
  draw_controls(stage);
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  part("registers", {s.list, 0.0F}, stage, draw_registers);
  ImGui::SameLine();
  ImGui::BeginGroup();
  const float height = ImGui::GetContentRegionAvail().y - s.bottom - ImGui::GetStyle().ItemSpacing.y;
  const float width = ImGui::GetContentRegionAvail().x - (s.program > 0.0F ? s.program + gap : 0.0F);
  part("large", {width, height}, stage, draw_large);
  if (s.program > 0.0F) {
    ImGui::SameLine();
    part("program", {s.program, height}, stage, draw_program);
  }
  draw_bottom(stage, s);
  ImGui::EndGroup();
  ImGui::End();
  if (stage.bench.help_shown) draw_help(stage);
}

}  // namespace apron::ui
