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

// Smallest sizes, in points.
constexpr float kMinRegisters = 110.0F, kMinProgram = 240.0F, kMinBottom = 90.0F, kMinValues = 120.0F,
                kMinLargeWidth = 220.0F, kMinLargeHeight = 160.0F;

// Sizes in pixels; program 0: shown as a tab.
struct PanelSizes {
  float registers = 0.0F, program = 0.0F, bottom = 0.0F, values = 0.0F;
};

PaneSizes& user_sizes(DrawContext& context) {
  return is_wide_layout(context) ? context.model.layout.wide : context.model.layout.narrow;
}

// The sizes that the user has chosen, or the defaults, as far as the area has room for the other panels.
PanelSizes panel_sizes(DrawContext& context, ImVec2 area) {
  const bool wide = is_wide_layout(context);
  const auto points = [&](float p) { return context.to_pixels(p); };
  PanelSizes sizes;
  sizes.registers = wide ? std::clamp(area.x * 0.175F, points(292), points(420))
                         : std::clamp(area.x * 0.24F, points(176), points(292));
  sizes.program = wide ? std::clamp(area.x * 0.37F, points(400), points(680)) : 0.0F;
  sizes.bottom = wide ? std::clamp(area.y * 0.28F, points(190), points(320)) : area.y * 0.38F;
  sizes.values = wide ? points(300) : std::clamp(area.x * 0.2F, points(176), points(300));
  const auto choose = [&](float& size, float chosen, float least, float most) {
    if (chosen > 0.0F) size = std::clamp(points(chosen), points(least), std::max(points(least), most));
  };
  const PaneSizes& user = user_sizes(context);
  const float beside_program = wide ? points(kMinProgram) : 0.0F;
  choose(sizes.registers, user.registers, kMinRegisters, area.x - points(kMinLargeWidth) - beside_program);
  if (wide)
    choose(sizes.program, user.program, kMinProgram, area.x - sizes.registers - points(kMinLargeWidth));
  choose(sizes.bottom, user.bottom, kMinBottom, area.y - points(kMinLargeHeight));
  choose(sizes.values, user.values, kMinValues, area.x - sizes.registers - points(kMinLargeWidth));
  return sizes;
}

struct Rect {
  ImVec2 at, size;
};

// The gap between two panels, dragged to resize; a double click restores the default. size_at: the size in
// pixels that puts the gap at a coordinate of the mouse.
template <typename SizeAt>
void draw_splitter(DrawContext& context, const char* name, const Rect& gap, bool vertical, float& user_size,
                   SizeAt size_at) {
  ImGui::SetCursorScreenPos(gap.at);
  ImGui::InvisibleButton(name, gap.size);
  const bool active = ImGui::IsItemActive(), hovered = ImGui::IsItemHovered();
  if (!active && !hovered) return;
  ImGui::SetMouseCursor(vertical ? ImGuiMouseCursor_ResizeEW : ImGuiMouseCursor_ResizeNS);
  const float middle = vertical ? gap.at.x + gap.size.x / 2.0F : gap.at.y + gap.size.y / 2.0F;
  const ImVec2 from = vertical ? ImVec2{middle, gap.at.y} : ImVec2{gap.at.x, middle};
  const ImVec2 to = vertical ? ImVec2{middle, gap.at.y + gap.size.y} : ImVec2{gap.at.x + gap.size.x, middle};
  ImGui::GetWindowDrawList()->AddLine(from, to, theme::kAccent, context.to_pixels(2));
  if (hovered && ImGui::IsMouseDoubleClicked(0)) {
    user_size = 0.0F;
  } else if (active && ImGui::IsMouseDragging(0, 1.0F)) {
    const float half = (vertical ? gap.size.x : gap.size.y) / 2.0F;
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    user_size = std::max(1.0F, size_at(vertical ? mouse.x : mouse.y, half) / context.to_pixels(1.0F));
  }
}

void draw_panel(const char* name, const Rect& area, DrawContext& context, void (*draw)(DrawContext&)) {
  ImGui::SetCursorScreenPos(area.at);
  ImGui::BeginChild(name, area.size, true, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse);
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

void draw_tabs(DrawContext& context) {
  if (!ImGui::BeginTabBar("tabs")) return;
  if (!is_wide_layout(context)) draw_tab("Program", context, draw_program);
  draw_tab("Console", context, draw_console_panel);
  draw_tab("Cell", context, draw_probe_panel, &context.model.probe_shown);
  draw_tab("Breakpoints", context, draw_breakpoint_panel);
  ImGui::EndTabBar();
}

// The register list on the left; beside it the large register and the program, and below them values and
// tabs.
void draw_panels(DrawContext& context) {
  const ImVec2 from = ImGui::GetCursorScreenPos(), area = ImGui::GetContentRegionAvail();
  const ImVec2 to{from + area}, gap = ImGui::GetStyle().ItemSpacing;
  const PanelSizes sizes = panel_sizes(context, area);
  const float main_x = from.x + sizes.registers + gap.x, main_width = to.x - main_x;
  const float bottom_y = to.y - sizes.bottom, main_height = bottom_y - gap.y - from.y;
  const float program_x = to.x - sizes.program;
  const float large_width = sizes.program > 0.0F ? program_x - gap.x - main_x : main_width;
  const float tabs_x = main_x + sizes.values + gap.x;
  draw_panel("registers", {from, {sizes.registers, area.y}}, context, draw_register_list);
  draw_panel("large", {{main_x, from.y}, {large_width, main_height}}, context, draw_register_view);
  if (sizes.program > 0.0F)
    draw_panel("program", {{program_x, from.y}, {sizes.program, main_height}}, context, draw_program);
  draw_panel("values", {{main_x, bottom_y}, {sizes.values, sizes.bottom}}, context, draw_values_panel);
  draw_panel("tabs", {{tabs_x, bottom_y}, {to.x - tabs_x, sizes.bottom}}, context, draw_tabs);

  PaneSizes& user = user_sizes(context);
  draw_splitter(context, "|registers", {{main_x - gap.x, from.y}, {gap.x, area.y}}, true, user.registers,
                [&](float mouse, float half) { return mouse - half - from.x; });
  if (sizes.program > 0.0F)
    draw_splitter(context, "|program", {{program_x - gap.x, from.y}, {gap.x, main_height}}, true,
                  user.program, [&](float mouse, float half) { return to.x - mouse - half; });
  draw_splitter(context, "|values", {{tabs_x - gap.x, bottom_y}, {gap.x, sizes.bottom}}, true, user.values,
                [&](float mouse, float half) { return mouse - half - main_x; });
  draw_splitter(context, "|bottom", {{main_x, bottom_y - gap.y}, {main_width, gap.y}}, false, user.bottom,
                [&](float mouse, float half) { return to.y - mouse - half; });
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
  draw_toolbar(context);
  draw_panels(context);
  ImGui::End();
  if (context.model.help_shown) draw_help(context);
}

}  // namespace apron::ui
