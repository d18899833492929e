// The bottom panels: values (variables, sliders, switches, labels), console, probe and breakpoints.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

ImVec4 faint_color() { return ImGui::ColorConvertU32ToFloat4(theme::kFaint); }

void draw_labels(const ViewModel& model) {
  for (const auto& [name, text] : model.panel().labels) {
    ImGui::TextUnformatted(name.c_str());
    if (text.empty()) continue;
    ImGui::SameLine();
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kAccent), "%s", text.c_str());
  }
}

void draw_parameters(DrawContext& context) {
  ViewModel& model = context.model;
  for (const program::Parameter& parameter : model.program().parameters) {
    float value = model.parameter(parameter);
    ImGui::PushID(parameter.name.c_str());
    if (parameter.is_switch) {
      bool on = value != 0.0F;
      if (ImGui::Checkbox(parameter.name.c_str(), &on)) model.set_parameter(parameter, on ? 1.0F : 0.0F);
    } else {
      ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x * 0.55F);
      if (ImGui::SliderFloat(parameter.name.c_str(), &value, parameter.low, parameter.high, "%.4g"))
        model.set_parameter(parameter, value);
    }
    ImGui::PopID();
  }
  (void)context;
}

void draw_variables(const ViewModel& model) {
  if (!ImGui::BeginTable("variables", 2, ImGuiTableFlags_RowBg)) return;
  const std::vector<program::Variable>& all = model.program().variables;
  for (std::size_t i = 0; i < std::min(all.size(), model.snapshot().variables.size()); ++i) {
    const bool internal = all[i].name.empty() || all[i].name.front() == '$' || all[i].name.front() == ':';
    if (internal && !model.temporaries_shown) continue;
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(all[i].name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(format_short(model.snapshot().variables[i]).c_str());
  }
  ImGui::EndTable();
}

// Formats a 3x3 neighbourhood as three lines.
std::string format_neighbourhood(const debugger::Neighbourhood& neighbourhood) {
  std::string text;
  for (std::size_t i = 0; i < neighbourhood.size(); ++i) {
    char number[24];
    if (std::isnan(neighbourhood[i]))
      std::snprintf(number, sizeof number, "%8s", "\u00b7");
    else
      std::snprintf(number, sizeof number, "%8.4g", static_cast<double>(neighbourhood[i]));
    text += number;
    if (i % 3 == 2 && i < 8) text += '\n';
  }
  return text;
}

// Plots the probed cell's value over the latest ticks, oldest at the left.
void draw_history(const DrawContext& context, const ViewModel& model, std::size_t reg, ImVec2 size) {
  const auto& history = model.snapshot().history;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.AddRectFilled(corner, {corner.x + size.x, corner.y + size.y}, theme::kBackdrop);
  std::vector<float> values;
  for (const auto& record : history)
    values.push_back(reg < record.values.size() ? record.values[reg] : std::nanf(""));
  const debugger::ValueRange range = debugger::automatic_range(values);
  std::vector<ImVec2> points;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    const float t = (values[i] - range.low) / (range.high - range.low);
    points.push_back({corner.x + size.x * (static_cast<float>(i) + 0.5F) / debugger::Probe::kMaxRecords,
                      corner.y + size.y - 2.0F - t * (size.y - 4.0F)});
  }
  list.AddPolyline(points.data(), static_cast<int>(points.size()), theme::kAccent, 0,
                   context.to_pixels(1.5F));
  ImGui::Dummy(size);
  if (ImGui::IsItemHovered() && !history.empty())
    ImGui::SetTooltip("ticks %llu to %llu, values %s to %s",
                      static_cast<unsigned long long>(history.front().tick),
                      static_cast<unsigned long long>(history.back().tick), format_short(range.low).c_str(),
                      format_short(range.high).c_str());
}

std::string describe_breakpoint(const debugger::Breakpoint& breakpoint) {
  switch (breakpoint.kind) {
    case debugger::Breakpoint::Kind::kLine:
      return breakpoint.file.substr(breakpoint.file.find_last_of('/') + 1) + ":" +
             std::to_string(breakpoint.line);
    case debugger::Breakpoint::Kind::kTick:
      return "tick " + std::to_string(breakpoint.tick);
    case debugger::Breakpoint::Kind::kCondition:
      return breakpoint.condition;
  }
  return {};
}

void draw_breakpoint_editor(DrawContext& context) {
  ViewModel& model = context.model;
  static char condition[256] = "", error[512] = "";
  static int tick = 100;
  ImGui::SetNextItemWidth(std::min(context.to_pixels(230), ImGui::GetContentRegionAvail().x * 0.45F));
  const bool typed = ImGui::InputTextWithHint("##condition", "globalsum(D) > 0", condition, sizeof condition,
                                              ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  if ((ImGui::Button("Stop when") || typed) && condition[0] != '\0') {
    std::snprintf(error, sizeof error, "%s", model.add_condition_breakpoint(condition).c_str());
    if (error[0] == '\0') condition[0] = '\0';
  }
  ImGui::SameLine(0.0F, context.to_pixels(16));
  ImGui::SetNextItemWidth(context.to_pixels(80));
  ImGui::InputInt("##tick", &tick, 0);
  ImGui::SameLine();
  if (ImGui::Button("Stop at tick") && tick > 0) model.add_tick_breakpoint(static_cast<std::uint64_t>(tick));
  if (error[0] != '\0') {
    ImGui::PushStyleColor(ImGuiCol_Text, theme::kStop);
    ImGui::TextWrapped("%s", error);
    ImGui::PopStyleColor();
  }
}

}  // namespace

void draw_values_panel(DrawContext& context) {
  const ViewModel& model = context.model;
  ImGui::TextUnformatted("Values");
  ImGui::BeginChild("values");
  draw_labels(model);
  draw_parameters(context);
  draw_variables(model);
  ImGui::EndChild();
}

void draw_console_panel(DrawContext& context) {
  const auto& lines = context.model.panel().console;
  if (lines.size() <= 1 && (lines.empty() || lines.front().empty()))
    return ImGui::TextColored(faint_color(), "What the program prints appears here.");
  ImGui::BeginChild("lines", {0.0F, 0.0F}, false, ImGuiWindowFlags_HorizontalScrollbar);
  ImGui::PushFont(context.gui.code());
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

void draw_probe_panel(DrawContext& context) {
  const ViewModel& model = context.model;
  ImGui::Text("Column %u, row %u", model.probed_cell.x, model.probed_cell.y);
  ImGui::SameLine();
  ImGui::TextColored(faint_color(), "with its neighbours, and over the latest %zu ticks",
                     debugger::Probe::kMaxRecords);
  constexpr ImGuiTableFlags kFlags = ImGuiTableFlags_RowBg | ImGuiTableFlags_ScrollY |
                                     ImGuiTableFlags_BordersInnerH | ImGuiTableFlags_SizingFixedFit;
  if (!ImGui::BeginTable("cell", 4, kFlags)) return;
  ImGui::TableSetupScrollFreeze(0, 1);
  ImGui::TableSetupColumn("Register", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(110));
  ImGui::TableSetupColumn("Value", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(70));
  ImGui::TableSetupColumn("Neighbours", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(210));
  ImGui::TableSetupColumn("History", ImGuiTableColumnFlags_WidthStretch);
  ImGui::TableHeadersRow();
  for (const std::size_t reg : model.listed_registers()) {
    if (reg >= model.snapshot().neighbourhoods.size()) break;
    const debugger::Neighbourhood& neighbourhood = model.snapshot().neighbourhoods[reg];
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(model.program().registers[reg].name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(std::isnan(neighbourhood[4]) ? "\u00b7" : format_short(neighbourhood[4]).c_str());
    ImGui::TableNextColumn();
    ImGui::PushFont(context.gui.code());
    ImGui::TextUnformatted(format_neighbourhood(neighbourhood).c_str());
    const float height = 3.0F * ImGui::GetTextLineHeight();
    ImGui::PopFont();
    ImGui::TableNextColumn();
    draw_history(context, model, reg, {ImGui::GetContentRegionAvail().x, height});
  }
  ImGui::EndTable();
}

void draw_breakpoint_panel(DrawContext& context) {
  ViewModel& model = context.model;
  draw_breakpoint_editor(context);
  for (std::size_t i = 0; i < model.breakpoints().size(); ++i) {
    bool on = model.breakpoints()[i].enabled;
    ImGui::PushID(static_cast<int>(i));
    const bool removed = ImGui::SmallButton("\u00d7");
    ImGui::SameLine();
    const bool toggled = ImGui::Checkbox(describe_breakpoint(model.breakpoints()[i]).c_str(), &on);
    ImGui::PopID();
    if (toggled) model.set_breakpoint_enabled(i, on);
    if (removed) {
      model.remove_breakpoint(i);
      break;
    }
  }
  if (model.breakpoints().empty())
    ImGui::TextColored(
        faint_color(),
        "Click left of a line's number to stop there; a condition stops when it becomes true.");
}

}  // namespace apron::ui
