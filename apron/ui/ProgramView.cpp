// The program's text with the line to come, breakpoints, folds, and where the time goes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

using debugger::Listing;

struct Columns {
  float number = 0.0F, fold = 0.0F, text = 0.0F;  // where they begin
  float spent = 0.0F;                             // width of the counts on the right
  float indent = 0.0F;                            // of a row inside a fold
};

ImU32 colour_of(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return ImGui::GetColorU32(ImGuiCol_Text);
  if (text.compare(first, 2, "//") == 0) return theme::kComment;
  return text[first] == '!' ? theme::kDirective : ImGui::GetColorU32(ImGuiCol_Text);
}

// The statement, and what is said about it behind it.
void code_text(ImDrawList& list, ImVec2 at, const std::string& text) {
  std::size_t comment = text.find("//");
  if (comment == std::string::npos) comment = text.size();
  const char* begin = text.c_str();
  list.AddText(at, colour_of(text), begin, begin + comment);
  const float width = ImGui::CalcTextSize(begin, begin + comment).x;
  if (comment < text.size()) list.AddText({at.x + width, at.y}, theme::kComment, begin + comment);
}

void triangle(ImDrawList& list, ImVec2 middle, float r, bool open) {
  const ImVec2& m = middle;
  if (open)
    list.AddTriangleFilled({m.x - r, m.y - r * 0.6F}, {m.x + r, m.y - r * 0.6F}, {m.x, m.y + r * 0.8F},
                           theme::kAccent);
  else
    list.AddTriangleFilled({m.x - r * 0.6F, m.y - r}, {m.x + r * 0.8F, m.y}, {m.x - r * 0.6F, m.y + r},
                           theme::kAccent);
}

void spent_text(ImDrawList& list, const Stage& stage, ImVec2 row, float right, float height,
                const vm::InstructionProfile& spent, double share) {
  if (spent.executions == 0) return;
  const float bar = stage.px(46) * static_cast<float>(share);
  list.AddRectFilled({right - stage.px(46), row.y + 2.0F},
                     {right - stage.px(46) + bar, row.y + height - 2.0F}, IM_COL32(235, 120, 60, 150));
  char text[48];
  std::snprintf(text, sizeof text, "%llu\u00d7  %4.1f%%", static_cast<unsigned long long>(spent.executions),
                share * 100.0);
  list.AddText({right - ImGui::CalcTextSize(text).x - stage.px(2), row.y + 1.0F}, theme::kFaint, text);
}

void gutter(Stage& stage, ImDrawList& list, ImVec2 at, float height, std::size_t number,
            const Columns& columns) {
  Workbench& bench = stage.bench;
  const Listing::Row& row = bench.listing().rows()[number];
  const ImVec2 dot{at.x + stage.px(9), at.y + height / 2.0F};
  ImGui::PushID(static_cast<int>(number));
  ImGui::SetCursorScreenPos(at);
  if (ImGui::InvisibleButton("stop", {columns.fold, height}) && row.code) bench.toggle_breakpoint(number);
  if (bench.has_breakpoint(row))
    list.AddCircleFilled(dot, stage.px(5), theme::kStop);
  else if (ImGui::IsItemHovered() && row.code)
    list.AddCircle(dot, stage.px(5), theme::kStop, 0, stage.px(1.3F));
  ImGui::PopID();
  if (row.line == 0) return;
  char text[16];
  std::snprintf(text, sizeof text, "%4u", row.line);
  list.AddText({at.x + columns.number, at.y + 1.0F}, theme::kFaint, text);
}

void draw_row(Stage& stage, std::size_t number, float height, const Columns& columns,
              const vm::InstructionProfile& spent, double total) {
  Workbench& bench = stage.bench;
  const Listing::Row row = bench.listing().rows()[number];
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  // What is in sight, however far the text is scrolled.
  const float bar = ImGui::GetScrollMaxY() > 0.0F ? ImGui::GetStyle().ScrollbarSize : 0.0F;
  const float right = ImGui::GetWindowPos().x + ImGui::GetWindowWidth() - bar;
  if (row.depth > 0) list.AddRectFilled(at, {right, at.y + height}, IM_COL32(60, 90, 140, 14));
  if (number == bench.current_row() && bench.look().mode != debugger::Mode::kRunning)
    list.AddRectFilled({at.x + columns.number, at.y}, {right, at.y + height}, theme::kCurrent, stage.px(3));
  gutter(stage, list, at, height, number, columns);
  const float indent = columns.indent * static_cast<float>(row.depth);
  if (row.fold != Listing::Fold::kNone) {
    ImGui::PushID(static_cast<int>(number) + 1'000'000);
    ImGui::SetCursorScreenPos({at.x + columns.fold + indent, at.y});
    const bool pressed = ImGui::InvisibleButton("fold", {stage.px(16), height});
    ImGui::PopID();
    triangle(list, {at.x + columns.fold + indent + stage.px(8), at.y + height / 2.0F}, stage.px(5),
             row.fold == Listing::Fold::kOpen);
    if (pressed) bench.listing().toggle(number);
  }
  const float limit = right - columns.spent;
  list.PushClipRect({at.x, at.y}, {limit, at.y + height}, true);
  const ImVec2 text{at.x + columns.text + indent, at.y + 1.0F};
  if (row.line == 0)
    list.AddText(text, theme::kAccent, row.text.c_str());
  else
    code_text(list, text, row.text);
  list.PopClipRect();
  if (columns.spent > 0.0F && total > 0.0)
    spent_text(list, stage, at, right, height, spent, static_cast<double>(spent.nanoseconds) / total);
  ImGui::SetCursorScreenPos({at.x, at.y + height});
}

void follow_current(Workbench& bench, float height) {
  if (!bench.follow || bench.look().mode == debugger::Mode::kRunning) return;
  const float at = static_cast<float>(bench.current_row()) * height;
  const float view = ImGui::GetWindowHeight(), top = ImGui::GetScrollY();
  if (at < top + 2.0F * height || at > top + view - 4.0F * height)
    ImGui::SetScrollY(std::max(0.0F, at - view * 0.4F));
}

void draw_head(Stage& stage) {
  Workbench& bench = stage.bench;
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(is_wide(stage) ? "Program" : "");
  const float box = ImGui::GetFrameHeight() + ImGui::CalcTextSize("Profile").x + stage.px(10);
  ImGui::SameLine(std::max(ImGui::GetCursorPosX(), ImGui::GetWindowContentRegionMax().x - box));
  if (ImGui::Checkbox("Profile", &bench.profile_shown)) bench.set_profiling(bench.profile_shown);
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip("How often each line ran and its share of the time, from now on");
}

Columns columns_of(const Stage& stage) {
  const float digit = ImGui::CalcTextSize("0").x;
  Columns columns;
  columns.number = stage.px(18);
  columns.fold = columns.number + 4.0F * digit + stage.px(3);
  columns.text = columns.fold + stage.px(17);
  columns.spent = stage.bench.profile_shown ? 17.0F * digit : 0.0F;
  columns.indent = stage.px(14);
  return columns;
}

// Of the longest row; bytes stand for characters, of which there are never more.
float text_width(const Listing& listing, const Columns& columns) {
  float longest = 0.0F;
  const float digit = ImGui::CalcTextSize("0").x;
  for (const Listing::Row& row : listing.rows())
    longest = std::max(longest, static_cast<float>(row.text.size()) * digit +
                                    columns.indent * static_cast<float>(row.depth));
  return columns.text + longest + columns.spent;
}

}  // namespace

void draw_program(Stage& stage) {
  Workbench& bench = stage.bench;
  draw_head(stage);
  ImGui::PushFont(stage.gui.code());
  const Columns columns = columns_of(stage);
  ImGui::SetNextWindowContentSize({text_width(bench.listing(), columns), 0.0F});
  ImGui::BeginChild("text", {0.0F, 0.0F}, false, ImGuiWindowFlags_HorizontalScrollbar);
  const float height = std::floor(ImGui::GetTextLineHeight() + stage.px(3));
  const std::vector<vm::InstructionProfile> spent = bench.profile_shown
                                                        ? bench.listing().by_row(bench.look().spent)
                                                        : std::vector<vm::InstructionProfile>();
  double total = 0.0;
  for (const vm::InstructionProfile& one : spent) total += static_cast<double>(one.nanoseconds);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {0.0F, 0.0F});
  follow_current(bench, height);
  if (ImGui::IsWindowHovered() && ImGui::GetIO().MouseWheel != 0.0F) bench.follow = false;
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(bench.listing().rows().size()), height);
  while (clipper.Step())
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      const auto row = static_cast<std::size_t>(i);
      if (row >= bench.listing().rows().size()) break;  // a fold was closed just now
      draw_row(stage, row, height, columns, row < spent.size() ? spent[row] : vm::InstructionProfile{},
               total);
    }
  clipper.End();
  ImGui::PopStyleVar();
  ImGui::EndChild();
  ImGui::PopFont();
}

}  // namespace apron::ui
