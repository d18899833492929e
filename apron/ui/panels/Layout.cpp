// Arranges the panels of the window.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

constexpr ImGuiWindowFlags kFixedWindowFlags =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
    ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav;

// Minimum width in points for a separate program column.
constexpr float kWideLayoutWidth = 1200.0F;

struct PanelSizes {
  float list = 0.0F, program = 0.0F, bottom = 0.0F, values = 0.0F;  // program 0: shown as a tab
};

PanelSizes panel_sizes(const DrawContext& context, ImVec2 available) {
  PanelSizes sizes;
  const bool wide = is_wide_layout(context);
  sizes.list = wide ? std::clamp(available.x * 0.175F, context.to_pixels(292), context.to_pixels(420))
                    : std::clamp(available.x * 0.24F, context.to_pixels(176), context.to_pixels(292));
  sizes.program =
      wide ? std::clamp(available.x * 0.37F, context.to_pixels(400), context.to_pixels(680)) : 0.0F;
  sizes.bottom = wide ? std::clamp(available.y * 0.28F, context.to_pixels(190), context.to_pixels(320))
                      : available.y * 0.38F;
  sizes.values = wide ? context.to_pixels(300)
                      : std::clamp(available.x * 0.2F, context.to_pixels(176), context.to_pixels(300));
  return sizes;
}

void draw_panel(const char* name, ImVec2 size, DrawContext& context, void (*draw)(DrawContext&)) {
  ImGui::BeginChild(name, size, true, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse);
  draw(context);
  ImGui::EndChild();
}

void draw_tab(const char* name, DrawContext& context, void (*draw)(DrawContext&), bool* shown = nullptr) {
  const bool open = ImGui::BeginTabItem(name);
  if (shown != nullptr) *shown = open;
  if (!open) return;
  draw(context);
  ImGui::EndTabItem();
}

void draw_tabs(DrawContext& context, bool with_program) {
  if (!ImGui::BeginTabBar("tabs")) return;
  if (with_program) draw_tab("Program", context, draw_program);
  draw_tab("Console", context, draw_console_panel);
  draw_tab("Cell", context, draw_probe_panel, &context.model.probe_shown);
  draw_tab("Breakpoints", context, draw_breakpoint_panel);
  ImGui::EndTabBar();
}

void draw_bottom(DrawContext& context, const PanelSizes& sizes) {
  draw_panel("values", {sizes.values, 0.0F}, context, draw_values_panel);
  ImGui::SameLine();
  ImGui::BeginChild("tabs", {0.0F, 0.0F}, true);
  draw_tabs(context, sizes.program == 0.0F);
  ImGui::EndChild();
}

}  // namespace

std::string format_short(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

bool is_wide_layout(const DrawContext& context) {
  return ImGui::GetIO().DisplaySize.x >= context.to_pixels(kWideLayoutWidth);
}

void draw_window(DrawContext& context) {
  handle_keys(context.model);
  const ImVec2 available = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({0.0F, 0.0F});
  ImGui::SetNextWindowSize(available);
  ImGui::Begin("apron", nullptr, kFixedWindowFlags);
  const PanelSizes sizes = panel_sizes(context, available);
  draw_toolbar(context);
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  draw_panel("registers", {sizes.list, 0.0F}, context, draw_register_list);
  ImGui::SameLine();
  ImGui::BeginGroup();
  const float height = ImGui::GetContentRegionAvail().y - sizes.bottom - ImGui::GetStyle().ItemSpacing.y;
  const float width = ImGui::GetContentRegionAvail().x - (sizes.program > 0.0F ? sizes.program + gap : 0.0F);
  draw_panel("large", {width, height}, context, draw_register_view);
  if (sizes.program > 0.0F) {
    ImGui::SameLine();
    draw_panel("program", {sizes.program, height}, context, draw_program);
  }
  draw_bottom(context, sizes);
  ImGui::EndGroup();
  ImGui::End();
  if (context.model.help_shown) draw_help(context);
}

}  // namespace apron::ui
