// The bottom panels: values (variables, sliders, switches, labels), console, probe and breakpoints.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
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

void draw_parameters(ViewModel& model) {
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
}

void draw_variables(const ViewModel& model) {
  if (!ImGui::BeginTable("variables", 2, ImGuiTableFlags_RowBg)) return;
  const std::vector<program::Variable>& all = model.program().variables;
  for (std::size_t i = 0; i < std::min(all.size(), model.snapshot().variables.size()); ++i) {
    if (!model.shows_name(all[i].name)) continue;
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(all[i].name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(format_short(model.snapshot().variables[i]).c_str());
  }
  ImGui::EndTable();
}

// Formats a 3x3 neighbourhood as three lines; of hexagons, the six that touch the cell.
std::string format_neighbourhood(const debugger::Neighbourhood& neighbourhood, const CellLayout& layout,
                                 std::uint32_t row) {
  std::string text;
  const std::size_t apart = layout.is_shifted(row) ? 0 : 2;  // the column of the two that do not touch
  for (std::size_t i = 0; i < neighbourhood.size(); ++i) {
    char number[24];
    if (layout.hexagonal() && i / 3 != 1) {
      if (i % 3 == 0) text += "    ";
      if (i % 3 == apart) {
        if (i % 3 == 2 && i < 8) text += '\n';
        continue;
      }
    }
    if (std::isnan(neighbourhood[i]))
      std::snprintf(number, sizeof number, "%8s", "\u00b7");
    else
      std::snprintf(number, sizeof number, "%8.4g", static_cast<double>(neighbourhood[i]));
    text += number;
    if (i % 3 == 2 && i < 8) text += '\n';
  }
  return text;
}

// The probed cell's values of a register, oldest first, with their ticks.
struct History {
  std::vector<std::uint64_t> ticks;
  std::vector<float> values;
  debugger::ValueRange range;
};

// The smallest and largest finite value; a range around a constant.
debugger::ValueRange finite_range(const std::vector<float>& values) {
  debugger::ValueRange range{std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest()};
  for (const float value : values) {
    if (!std::isfinite(value)) continue;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  if (range.low > range.high) return {0.0F, 1.0F};
  if (range.low == range.high) return {range.low - 1.0F, range.high + 1.0F};
  return range;
}

History history_of(const ViewModel& model, std::size_t reg) {
  History history;
  for (const debugger::Probe::Record& record : model.snapshot().history) {
    history.ticks.push_back(record.tick);
    history.values.push_back(reg < record.values.size() ? record.values[reg] : std::nanf(""));
  }
  history.range = finite_range(history.values);
  return history;
}

// Plots the values from left to right over the whole width; a tooltip reads the one at the mouse.
void draw_curve(const DrawContext& context, const History& history, ImVec2 size) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.AddRectFilled(corner, corner + size, theme::kBackdrop);
  const std::size_t count = history.values.size();
  const float step = size.x / static_cast<float>(std::max<std::size_t>(count, 32));
  const debugger::ValueRange& range = history.range;
  std::vector<ImVec2> points;
  const auto flush = [&] {
    list.AddPolyline(points.data(), static_cast<int>(points.size()), theme::kAccent, 0,
                     context.to_pixels(1.5F));
    points.clear();
  };
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(history.values[i])) {
      flush();
      continue;
    }
    const float t = (history.values[i] - range.low) / (range.high - range.low);
    points.push_back({corner.x + step * (static_cast<float>(i) + 0.5F),
                      corner.y + size.y - 2.0F - std::clamp(t, 0.0F, 1.0F) * (size.y - 4.0F)});
  }
  flush();
  ImGui::InvisibleButton("curve", {std::max(size.x, 1.0F), std::max(size.y, 1.0F)});
  if (!ImGui::IsItemHovered() || count == 0) return;
  const auto at = std::min(
      static_cast<std::size_t>(std::max(0.0F, ImGui::GetIO().MousePos.x - corner.x) / step), count - 1);
  const float x = corner.x + step * (static_cast<float>(at) + 0.5F);
  list.AddLine({x, corner.y}, {x, corner.y + size.y}, theme::kFaint);
  ImGui::SetTooltip("tick %llu: %s", static_cast<unsigned long long>(history.ticks[at]),
                    format_short(history.values[at]).c_str());
}

// One register's history at the size of the panel, with its axes.
void draw_enlarged_history(DrawContext& context, std::size_t reg) {
  ViewModel& model = context.model;
  const bool back = ImGui::Button("All registers");
  ImGui::SameLine();
  ImGui::Text("%s, column %u, row %u", model.program().registers[reg].name.c_str(), model.probed_cell.x,
              model.probed_cell.y);
  const History history = history_of(model, reg);
  const std::string high = format_short(history.range.high), low = format_short(history.range.low);
  const float line = ImGui::GetTextLineHeight();
  const float margin = std::max(ImGui::CalcTextSize(high.c_str()).x, ImGui::CalcTextSize(low.c_str()).x) +
                       context.to_pixels(6);
  const ImVec2 corner = ImGui::GetCursorScreenPos(), available = ImGui::GetContentRegionAvail();
  const ImVec2 size{std::max(available.x - margin, 1.0F),
                    std::max(available.y - line - context.to_pixels(3), line)};
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.AddText(corner, theme::kFaint, high.c_str());
  list.AddText({corner.x, corner.y + size.y - line}, theme::kFaint, low.c_str());
  ImGui::SetCursorScreenPos({corner.x + margin, corner.y});
  draw_curve(context, history, size);
  if (!history.ticks.empty()) {
    const std::string first = "tick " + std::to_string(history.ticks.front()),
                      last = std::to_string(history.ticks.back());
    const float y = corner.y + size.y + context.to_pixels(2);
    list.AddText({corner.x + margin, y}, theme::kFaint, first.c_str());
    list.AddText({corner.x + margin + size.x - ImGui::CalcTextSize(last.c_str()).x, y}, theme::kFaint,
                 last.c_str());
  }
  if (back) model.enlarged_history.reset();
}

std::string describe_breakpoint(const debugger::Breakpoint& breakpoint) {
  switch (breakpoint.kind) {
    case debugger::Breakpoint::Kind::kLine:
      return breakpoint.file.substr(breakpoint.file.find_last_of('/') + 1) + ":" +
             std::to_string(breakpoint.line);
    case debugger::Breakpoint::Kind::kTick:
      return "tick " + std::to_string(breakpoint.tick);
    case debugger::Breakpoint::Kind::kCondition:
      return (breakpoint.on_change ? "change of " : "") + breakpoint.condition;
  }
  return {};
}

// Continues the line if an item of the width still fits.
void same_line_if_fits(float width) {
  const float right = ImGui::GetItemRectMax().x + ImGui::GetStyle().ItemSpacing.x + width;
  if (right <= ImGui::GetWindowPos().x + ImGui::GetWindowContentRegionMax().x) ImGui::SameLine();
}

float padded_width(const char* label) {
  return ImGui::CalcTextSize(label).x + 2.0F * ImGui::GetStyle().FramePadding.x;
}

void draw_breakpoint_editor(DrawContext& context) {
  ViewModel& model = context.model;
  static char condition[256] = "", error[512] = "";
  static int tick = 100;
  const float width = ImGui::GetContentRegionAvail().x, gap = ImGui::GetStyle().ItemSpacing.x;
  const float stop_when = padded_width("Stop when"), stop_at = padded_width("Stop at tick"),
              stop_change = padded_width("Stop at change");
  ImGui::SetNextItemWidth(
      std::clamp(width - stop_when - gap, context.to_pixels(120), context.to_pixels(360)));
  const bool typed = ImGui::InputTextWithHint("##condition", "globalsum(D) > 0", condition, sizeof condition,
                                              ImGuiInputTextFlags_EnterReturnsTrue);
  same_line_if_fits(stop_when);
  const bool when = ImGui::Button("Stop when") || typed;
  same_line_if_fits(stop_change);
  const bool on_change = ImGui::Button("Stop at change");
  if ((when || on_change) && condition[0] != '\0') {
    std::snprintf(error, sizeof error, "%s", model.add_condition_breakpoint(condition, on_change).c_str());
    if (error[0] == '\0') condition[0] = '\0';
  }
  const float tick_width = context.to_pixels(80);
  same_line_if_fits(tick_width + gap + stop_at);
  ImGui::SetNextItemWidth(tick_width);
  ImGui::InputInt("##tick", &tick, 0);
  same_line_if_fits(stop_at);
  if (ImGui::Button("Stop at tick") && tick > 0) model.add_tick_breakpoint(static_cast<std::uint64_t>(tick));
  if (error[0] != '\0') {
    ImGui::PushStyleColor(ImGuiCol_Text, theme::kStop);
    ImGui::TextWrapped("%s", error);
    ImGui::PopStyleColor();
  }
}

}  // namespace

void draw_values_panel(DrawContext& context) {
  ViewModel& model = context.model;
  ImGui::TextUnformatted("Values");
  ImGui::BeginChild("values");
  draw_labels(model);
  draw_parameters(model);
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
      const std::string& line = lines[i];
      ImGui::TextUnformatted(line.c_str(), line.c_str() + line.size());
    }
  clipper.End();
  ImGui::PopFont();
  if (at_end) ImGui::SetScrollHereY(1.0F);
  ImGui::EndChild();
}

void draw_probe_panel(DrawContext& context) {
  ViewModel& model = context.model;
  if (model.enlarged_history) return draw_enlarged_history(context, *model.enlarged_history);
  constexpr ImGuiTableFlags kFlags = ImGuiTableFlags_RowBg | ImGuiTableFlags_ScrollY |
                                     ImGuiTableFlags_Resizable | ImGuiTableFlags_BordersInnerH |
                                     ImGuiTableFlags_SizingFixedFit;
  // The curve has at least a third of the width; the neighbours give way.
  const float width = ImGui::GetContentRegionAvail().x;
  const bool with_neighbours = width >= context.to_pixels(520);
  ImGui::PushStyleColor(ImGuiCol_Text, theme::kFaint);
  ImGui::TextWrapped("Column %u, row %u%s, and the latest %zu ticks (click a curve to enlarge it)",
                     model.probed_cell.x, model.probed_cell.y, with_neighbours ? ", its neighbours" : "",
                     debugger::Probe::kMaxRecords);
  ImGui::PopStyleColor();
  if (!ImGui::BeginTable("cell", with_neighbours ? 4 : 3, kFlags)) return;
  ImGui::TableSetupScrollFreeze(0, 1);
  ImGui::TableSetupColumn("Register", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(100));
  ImGui::TableSetupColumn("Value", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(70));
  if (with_neighbours)
    ImGui::TableSetupColumn("Neighbours", ImGuiTableColumnFlags_WidthFixed, context.to_pixels(210));
  ImGui::TableSetupColumn("History", ImGuiTableColumnFlags_WidthStretch);
  ImGui::TableHeadersRow();
  for (const std::size_t reg : model.listed_registers()) {
    if (reg >= model.snapshot().neighbourhoods.size()) break;
    const debugger::Neighbourhood& neighbourhood = model.snapshot().neighbourhoods[reg];
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    const std::string& name = model.program().registers[reg].name;
    if (ImGui::SmallButton(name.c_str())) {
      const debugger::Cell& cell = model.probed_cell;
      const std::string error =
          model.add_condition_breakpoint(debugger::cell_expression(name, cell.x, cell.y), true);
      if (!error.empty()) model.notice = error;
    }
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("Stop when this cell changes");
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(std::isnan(neighbourhood[4]) ? "\u00b7" : format_short(neighbourhood[4]).c_str());
    ImGui::PushFont(context.gui.code());
    const float height = 3.0F * ImGui::GetTextLineHeight();
    if (with_neighbours) {
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(
          format_neighbourhood(neighbourhood, model.cell_layout(reg), model.probed_cell.y).c_str());
    }
    ImGui::PopFont();
    ImGui::TableNextColumn();
    ImGui::PushID(static_cast<int>(reg));
    draw_curve(context, history_of(model, reg), {ImGui::GetContentRegionAvail().x, height});
    if (ImGui::IsItemClicked()) model.enlarged_history = reg;
    ImGui::PopID();
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
    const bool toggled = ImGui::Checkbox("##on", &on);
    ImGui::SameLine();
    ImGui::TextWrapped("%s", describe_breakpoint(model.breakpoints()[i]).c_str());
    ImGui::PopID();
    if (toggled) model.set_breakpoint_enabled(i, on);
    if (removed) {
      model.remove_breakpoint(i);
      break;
    }
  }
  if (!model.breakpoints().empty()) return;
  ImGui::PushStyleColor(ImGuiCol_Text, theme::kFaint);
  ImGui::TextWrapped("Click left of a line's number to stop there; a condition stops when it becomes true.");
  ImGui::PopStyleColor();
}

}  // namespace apron::ui
