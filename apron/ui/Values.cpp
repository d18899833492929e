// Numbers and words: variables, sliders, switches and labels; the console; one cell through all registers;
// the list of breakpoints.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

ImVec4 faint() { return ImGui::ColorConvertU32ToFloat4(theme::kFaint); }

void draw_labels(const Workbench& bench) {
  for (const auto& [name, text] : bench.panel().labels) {
    ImGui::TextUnformatted(name.c_str());
    if (text.empty()) continue;
    ImGui::SameLine();
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kAccent), "%s", text.c_str());
  }
}

void draw_parameters(Stage& stage) {
  Workbench& bench = stage.bench;
  for (const program::Parameter& parameter : bench.program().parameters) {
    float value = bench.parameter(parameter);
    ImGui::PushID(parameter.name.c_str());
    if (parameter.is_switch) {
      bool on = value != 0.0F;
      if (ImGui::Checkbox(parameter.name.c_str(), &on)) bench.set_parameter(parameter, on ? 1.0F : 0.0F);
    } else {
      ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x * 0.55F);
      if (ImGui::SliderFloat(parameter.name.c_str(), &value, parameter.low, parameter.high, "%.4g"))
        bench.set_parameter(parameter, value);
    }
    ImGui::PopID();
  }
  (void)stage;
}

void draw_variables(const Workbench& bench) {
  if (!ImGui::BeginTable("variables", 2, ImGuiTableFlags_RowBg)) return;
  const std::vector<program::Variable>& all = bench.program().variables;
  for (std::size_t i = 0; i < std::min(all.size(), bench.look().variables.size()); ++i) {
    const bool internal = all[i].name.empty() || all[i].name.front() == '$' || all[i].name.front() == ':';
    if (internal && !bench.temporaries_shown) continue;
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(all[i].name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(short_number(bench.look().variables[i]).c_str());
  }
  ImGui::EndTable();
}

// The cell's neighbourhood as three short rows.
std::string around_text(const debugger::Around& around) {
  std::string text;
  for (std::size_t i = 0; i < around.size(); ++i) {
    char number[24];
    if (std::isnan(around[i]))
      std::snprintf(number, sizeof number, "%8s", "\u00b7");
    else
      std::snprintf(number, sizeof number, "%8.4g", static_cast<double>(around[i]));
    text += number;
    if (i % 3 == 2 && i < 8) text += '\n';
  }
  return text;
}

// What the cell held over the latest ticks, as a line from left to right.
void draw_history(const Stage& stage, const Workbench& bench, std::size_t reg, ImVec2 size) {
  const auto& history = bench.look().history;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.AddRectFilled(at, {at.x + size.x, at.y + size.y}, theme::kBackdrop);
  std::vector<float> values;
  for (const auto& record : history)
    values.push_back(reg < record.values.size() ? record.values[reg] : std::nanf(""));
  const debugger::Range range = debugger::automatic_range(values);
  std::vector<ImVec2> points;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    const float t = (values[i] - range.low) / (range.high - range.low);
    points.push_back({at.x + size.x * (static_cast<float>(i) + 0.5F) / debugger::Probe::kTicks,
                      at.y + size.y - 2.0F - t * (size.y - 4.0F)});
  }
  list.AddPolyline(points.data(), static_cast<int>(points.size()), theme::kAccent, 0, stage.px(1.5F));
  ImGui::Dummy(size);
  if (ImGui::IsItemHovered() && !history.empty())
    ImGui::SetTooltip("ticks %llu to %llu, values %s to %s",
                      static_cast<unsigned long long>(history.front().tick),
                      static_cast<unsigned long long>(history.back().tick), short_number(range.low).c_str(),
                      short_number(range.high).c_str());
}

std::string describe(const debugger::Breakpoint& one) {
  switch (one.kind) {
    case debugger::Breakpoint::Kind::kLine:
      return one.file.substr(one.file.find_last_of('/') + 1) + ":" + std::to_string(one.line);
    case debugger::Breakpoint::Kind::kTick:
      return "tick " + std::to_string(one.tick);
    case debugger::Breakpoint::Kind::kCondition:
      return one.condition;
  }
  return {};
}

void draw_new_breakpoints(Stage& stage) {
  Workbench& bench = stage.bench;
  static char condition[256] = "", wrong[512] = "";
  static int tick = 100;
  ImGui::SetNextItemWidth(std::min(stage.px(230), ImGui::GetContentRegionAvail().x * 0.45F));
  const bool typed = ImGui::InputTextWithHint("##condition", "globalsum(D) > 0", condition, sizeof condition,
                                              ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  if ((ImGui::Button("Stop when") || typed) && condition[0] != '\0') {
    std::snprintf(wrong, sizeof wrong, "%s", bench.add_condition(condition).c_str());
    if (wrong[0] == '\0') condition[0] = '\0';
  }
  ImGui::SameLine(0.0F, stage.px(16));
  ImGui::SetNextItemWidth(stage.px(80));
  ImGui::InputInt("##tick", &tick, 0);
  ImGui::SameLine();
  if (ImGui::Button("Stop at tick") && tick > 0) bench.add_tick_breakpoint(static_cast<std::uint64_t>(tick));
  if (wrong[0] != '\0') {
    ImGui::PushStyleColor(ImGuiCol_Text, theme::kStop);
    ImGui::TextWrapped("%s", wrong);
    ImGui::PopStyleColor();
  }
}

}  // namespace

void draw_values(Stage& stage) {
  const Workbench& bench = stage.bench;
  ImGui::TextUnformatted("Values");
  ImGui::BeginChild("values");
  draw_labels(bench);
  draw_parameters(stage);
  draw_variables(bench);
  ImGui::EndChild();
}

void draw_console(Stage& stage) {
  const auto& lines = stage.bench.panel().console;
  if (lines.size() <= 1 && (lines.empty() || lines.front().empty()))
    return ImGui::TextColored(faint(), "What the program prints appears here.");
  ImGui::BeginChild("lines", {0.0F, 0.0F}, false, ImGuiWindowFlags_HorizontalScrollbar);
  ImGui::PushFont(stage.gui.code());
  const bool at_end = ImGui::GetScrollY() >= ImGui::GetScrollMaxY() - 1.0F;
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(lines.size()));
  while (clipper.Step())
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      const std::string& line = lines[static_cast<std::size_t>(i)];
      ImGui::TextUnformatted(line.c_str(), line.c_str() + line.size());
    }
  clipper.End();
  ImGui::PopFont();
  if (at_end) ImGui::SetScrollHereY(1.0F);
  ImGui::EndChild();
}

void draw_cell(Stage& stage) {
  const Workbench& bench = stage.bench;
  ImGui::Text("Column %u, row %u", bench.cell.x, bench.cell.y);
  ImGui::SameLine();
  ImGui::TextColored(faint(), "with its neighbours, and over the latest %zu ticks", debugger::Probe::kTicks);
  constexpr ImGuiTableFlags kFlags = ImGuiTableFlags_RowBg | ImGuiTableFlags_ScrollY |
                                     ImGuiTableFlags_BordersInnerH | ImGuiTableFlags_SizingFixedFit;
  if (!ImGui::BeginTable("cell", 4, kFlags)) return;
  ImGui::TableSetupScrollFreeze(0, 1);
  ImGui::TableSetupColumn("Register", ImGuiTableColumnFlags_WidthFixed, stage.px(110));
  ImGui::TableSetupColumn("Value", ImGuiTableColumnFlags_WidthFixed, stage.px(70));
  ImGui::TableSetupColumn("Neighbours", ImGuiTableColumnFlags_WidthFixed, stage.px(210));
  ImGui::TableSetupColumn("History", ImGuiTableColumnFlags_WidthStretch);
  ImGui::TableHeadersRow();
  for (const std::size_t reg : bench.listed()) {
    if (reg >= bench.look().around.size()) break;
    const debugger::Around& around = bench.look().around[reg];
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(bench.program().registers[reg].name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(std::isnan(around[4]) ? "\u00b7" : short_number(around[4]).c_str());
    ImGui::TableNextColumn();
    ImGui::PushFont(stage.gui.code());
    ImGui::TextUnformatted(around_text(around).c_str());
    const float height = 3.0F * ImGui::GetTextLineHeight();
    ImGui::PopFont();
    ImGui::TableNextColumn();
    draw_history(stage, bench, reg, {ImGui::GetContentRegionAvail().x, height});
  }
  ImGui::EndTable();
}

void draw_breakpoints(Stage& stage) {
  Workbench& bench = stage.bench;
  draw_new_breakpoints(stage);
  for (std::size_t i = 0; i < bench.breakpoints().size(); ++i) {
    bool on = bench.breakpoints()[i].on;
    ImGui::PushID(static_cast<int>(i));
    const bool removed = ImGui::SmallButton("\u00d7");
    ImGui::SameLine();
    const bool switched = ImGui::Checkbox(describe(bench.breakpoints()[i]).c_str(), &on);
    ImGui::PopID();
    if (switched) bench.switch_breakpoint(i, on);
    if (removed) {
      bench.remove_breakpoint(i);
      break;
    }
  }
  if (bench.breakpoints().empty())
    ImGui::TextColored(
        faint(), "Click left of a line's number to stop there; a condition stops when it becomes true.");
}

}  // namespace apron::ui
