// The program panel: source text with current line, breakpoints, folds and profile.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

using debugger::Listing;

struct ColumnLayout {
  float number = 0.0F, fold = 0.0F, text = 0.0F;  // left edges
  float profile_width = 0.0F;                     // of the counts on the right
  float indent = 0.0F;                            // per level of folding
};

ImU32 text_color(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return ImGui::GetColorU32(ImGuiCol_Text);
  if (text.compare(first, 2, "//") == 0) return theme::kComment;
  return text[first] == '!' ? theme::kDirective : ImGui::GetColorU32(ImGuiCol_Text);
}

// Draws a statement and its trailing comment in different colours.
void draw_code(ImDrawList& list, ImVec2 at, const std::string& text) {
  std::size_t comment = text.find("//");
  if (comment == std::string::npos) comment = text.size();
  const char* begin = text.c_str();
  list.AddText(at, text_color(text), begin, begin + comment);
  const float width = ImGui::CalcTextSize(begin, begin + comment).x;
  if (comment < text.size()) list.AddText({at.x + width, at.y}, theme::kComment, begin + comment);
}

void draw_fold_triangle(ImDrawList& list, ImVec2 middle, float r, bool open) {
  const ImVec2& m = middle;
  if (open)
    list.AddTriangleFilled({m.x - r, m.y - r * 0.6F}, {m.x + r, m.y - r * 0.6F}, {m.x, m.y + r * 0.8F},
                           theme::kAccent);
  else
    list.AddTriangleFilled({m.x - r * 0.6F, m.y - r}, {m.x + r * 0.8F, m.y}, {m.x - r * 0.6F, m.y + r},
                           theme::kAccent);
}

void draw_row_profile(ImDrawList& list, const DrawContext& context, ImVec2 row, float right, float height,
                      const vm::InstructionProfile& profile, double share) {
  if (profile.executions == 0) return;
  const float bar = context.to_pixels(46) * static_cast<float>(share);
  list.AddRectFilled({right - context.to_pixels(46), row.y + 2.0F},
                     {right - context.to_pixels(46) + bar, row.y + height - 2.0F},
                     IM_COL32(235, 120, 60, 150));
  char text[48];
  std::snprintf(text, sizeof text, "%llu\u00d7  %4.1f%%", static_cast<unsigned long long>(profile.executions),
                share * 100.0);
  list.AddText({right - ImGui::CalcTextSize(text).x - context.to_pixels(2), row.y + 1.0F}, theme::kFaint,
               text);
}

void draw_gutter(DrawContext& context, ImDrawList& list, ImVec2 at, float height, std::size_t number,
                 const ColumnLayout& columns) {
  ViewModel& model = context.model;
  const Listing::Row& row = model.listing().rows()[number];
  const ImVec2 dot{at.x + context.to_pixels(9), at.y + height / 2.0F};
  ImGui::PushID(static_cast<int>(number));
  ImGui::SetCursorScreenPos(at);
  if (ImGui::InvisibleButton("stop", {columns.fold, height}) && row.has_code) model.toggle_breakpoint(number);
  if (model.has_breakpoint(row))
    list.AddCircleFilled(dot, context.to_pixels(5), theme::kStop);
  else if (ImGui::IsItemHovered() && row.has_code)
    list.AddCircle(dot, context.to_pixels(5), theme::kStop, 0, context.to_pixels(1.3F));
  ImGui::PopID();
  if (row.line == 0) return;
  char text[16];
  std::snprintf(text, sizeof text, "%4u", row.line);
  list.AddText({at.x + columns.number, at.y + 1.0F}, theme::kFaint, text);
}

void draw_row(DrawContext& context, std::size_t number, float height, const ColumnLayout& columns,
              const vm::InstructionProfile& profile, double total) {
  ViewModel& model = context.model;
  const Listing::Row row = model.listing().rows()[number];
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  // The right edge of the visible area, independent of horizontal scrolling.
  const float bar = ImGui::GetScrollMaxY() > 0.0F ? ImGui::GetStyle().ScrollbarSize : 0.0F;
  const float right = ImGui::GetWindowPos().x + ImGui::GetWindowWidth() - bar;
  if (row.depth > 0) list.AddRectFilled(at, {right, at.y + height}, IM_COL32(60, 90, 140, 14));
  if (number == model.current_row() && model.snapshot().mode != debugger::ExecutionState::kRunning)
    list.AddRectFilled({at.x + columns.number, at.y}, {right, at.y + height}, theme::kCurrent,
                       context.to_pixels(3));
  if (model.found_row == number)
    list.AddRect({at.x + columns.number, at.y}, {right, at.y + height}, theme::kAccent, context.to_pixels(3));
  draw_gutter(context, list, at, height, number, columns);
  const float indent = columns.indent * static_cast<float>(row.depth);
  if (row.fold != Listing::Fold::kNone) {
    ImGui::PushID(static_cast<int>(number) + 1'000'000);
    ImGui::SetCursorScreenPos({at.x + columns.fold + indent, at.y});
    const bool pressed = ImGui::InvisibleButton("fold", {context.to_pixels(16), height});
    ImGui::PopID();
    draw_fold_triangle(list, {at.x + columns.fold + indent + context.to_pixels(8), at.y + height / 2.0F},
                       context.to_pixels(5), row.fold == Listing::Fold::kOpen);
    if (pressed) model.listing().toggle(number);
  }
  const float limit = right - columns.profile_width;
  list.PushClipRect({at.x, at.y}, {limit, at.y + height}, true);
  const ImVec2 text{at.x + columns.text + indent, at.y + 1.0F};
  if (row.line == 0)
    list.AddText(text, theme::kAccent, row.text.c_str());
  else
    draw_code(list, text, row.text);
  list.PopClipRect();
  if (columns.profile_width > 0.0F && total > 0.0)
    draw_row_profile(list, context, at, right, height, profile,
                     static_cast<double>(profile.nanoseconds) / total);
  ImGui::SetCursorScreenPos({at.x, at.y + height});
}

void scroll_to_current(ViewModel& model, float height) {
  if (std::exchange(model.scroll_to_found, false) && model.found_row)
    ImGui::SetScrollY(
        std::max(0.0F, static_cast<float>(*model.found_row) * height - ImGui::GetWindowHeight() * 0.4F));
  if (!model.follow_current_line || model.snapshot().mode == debugger::ExecutionState::kRunning) return;
  const float at = static_cast<float>(model.current_row()) * height;
  const float view_height = ImGui::GetWindowHeight(), top = ImGui::GetScrollY();
  if (at < top + 2.0F * height || at > top + view_height - 4.0F * height)
    ImGui::SetScrollY(std::max(0.0F, at - view_height * 0.4F));
}

// Finds while the user types; Enter goes to the next occurrence.
void draw_search(DrawContext& context) {
  ViewModel& model = context.model;
  ImGui::SetNextItemWidth(context.to_pixels(150));
  if (std::exchange(model.focus_search, false)) ImGui::SetKeyboardFocusHere();
  const bool next = ImGui::InputTextWithHint("##search", "Find, or line number", model.search_text.data(),
                                             model.search_text.size(), ImGuiInputTextFlags_EnterReturnsTrue);
  draw_tooltip("Ctrl-F; Enter: next");
  if (!next && !ImGui::IsItemEdited()) return;
  if (next) ImGui::SetKeyboardFocusHere(-1);
  model.found_row =
      model.find_row(model.search_text.data(), next && model.found_row ? *model.found_row + 1 : 0);
  model.scroll_to_found = model.found_row.has_value();
  if (model.found_row) model.follow_current_line = false;
}

void open_editor(ViewModel& model) {
  const std::size_t row = model.found_row.value_or(model.current_row());
  const std::vector<Listing::Row>& rows = model.listing().rows();
  if (row < rows.size() && (model.found_row || !model.running()))
    model.editor.open(rows[row].file, rows[row].line);
  else
    model.editor.shown = true;
}

void draw_header(DrawContext& context) {
  ViewModel& model = context.model;
  if (ImGui::Button("Edit")) open_editor(model);
  draw_tooltip("Edit the program at the line that was found or comes next (Ctrl-E)");
  ImGui::SameLine();
  draw_search(context);
  const float box = ImGui::GetFrameHeight() + ImGui::CalcTextSize("Profile").x + context.to_pixels(10);
  ImGui::SameLine(std::max(ImGui::GetCursorPosX(), ImGui::GetWindowContentRegionMax().x - box));
  if (ImGui::Checkbox("Profile", &model.profile_shown)) model.set_profiling(model.profile_shown);
  draw_tooltip("Count the executions of each line and measure its share of the time, from now on");
}

ColumnLayout column_layout(const DrawContext& context) {
  const float digit = ImGui::CalcTextSize("0").x;
  ColumnLayout layout;
  layout.number = context.to_pixels(18);
  layout.fold = layout.number + 4.0F * digit + context.to_pixels(3);
  layout.text = layout.fold + context.to_pixels(17);
  layout.profile_width = context.model.profile_shown ? 17.0F * digit : 0.0F;
  layout.indent = context.to_pixels(14);
  return layout;
}

// The width of the longest row; counts bytes, which is an upper bound for characters.
float text_width(const Listing& listing, const ColumnLayout& columns) {
  float longest = 0.0F;
  const float digit = ImGui::CalcTextSize("0").x;
  for (const Listing::Row& row : listing.rows())
    longest = std::max(longest, static_cast<float>(row.text.size()) * digit +
                                    columns.indent * static_cast<float>(row.depth));
  return columns.text + longest + columns.profile_width;
}

}  // namespace

void draw_program(DrawContext& context) {
  ViewModel& model = context.model;
  if (model.editor.shown && model.editor.current() != nullptr) return draw_editor(context);
  draw_header(context);
  ImGui::PushFont(context.gui.code());
  const ColumnLayout columns = column_layout(context);
  ImGui::SetNextWindowContentSize({text_width(model.listing(), columns), 0.0F});
  ImGui::BeginChild("text", {0.0F, 0.0F}, false, ImGuiWindowFlags_HorizontalScrollbar);
  const float height = std::floor(ImGui::GetTextLineHeight() + context.to_pixels(3));
  const std::vector<vm::InstructionProfile> profile =
      model.profile_shown ? model.listing().profile_by_row(model.snapshot().profile)
                          : std::vector<vm::InstructionProfile>();
  double total = 0.0;
  for (const vm::InstructionProfile& row_profile : profile)
    total += static_cast<double>(row_profile.nanoseconds);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {0.0F, 0.0F});
  scroll_to_current(model, height);
  if (ImGui::IsWindowHovered() && ImGui::GetIO().MouseWheel != 0.0F) model.follow_current_line = false;
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(model.listing().rows().size()), height);
  while (clipper.Step())
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      const std::size_t row = i;
      if (row >= model.listing().rows().size()) break;  // a click on a previous row closed a fold
      draw_row(context, row, height, columns, row < profile.size() ? profile[row] : vm::InstructionProfile{},
               total);
    }
  clipper.End();
  ImGui::PopStyleVar();
  ImGui::EndChild();
  ImGui::PopFont();
}

}  // namespace apron::ui
