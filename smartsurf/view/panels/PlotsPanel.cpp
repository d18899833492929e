#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "common/text/Unit.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

constexpr ImU32 kAxisColour = IM_COL32(150, 158, 168, 255), kGridColour = IM_COL32(205, 211, 218, 255),
                kTextColour = IM_COL32(70, 78, 90, 255), kNowColour = IM_COL32(40, 44, 52, 200),
                kPaperColour = IM_COL32(255, 255, 255, 235);

// Maps times and values to pixels.
struct ChartArea {
  ImVec2 low, high;  // upper left and lower right corner
  double from_s, to_s;
  common::AxisRange values;
  float x(double time_s) const {
    return low.x + static_cast<float>((time_s - from_s) / (to_s - from_s)) * (high.x - low.x);
  }
  float y(double value) const {
    return high.y - static_cast<float>((value - values.low) / (values.high - values.low)) * (high.y - low.y);
  }
};

constexpr float kLabelGap = 5.0f;
constexpr double kMinSpan_s = 1e-3;  // of the axis of times

std::vector<double> value_ticks(const ChartArea& area) {
  const double rows = std::max(1.0f, std::floor((area.high.y - area.low.y) / (1.7f * ImGui::GetFontSize())));
  return common::tick_values(area.values.low, area.values.high, rows);
}

float widest(const std::vector<std::string>& labels) {
  float width = 0.0f;
  for (const std::string& label : labels) width = std::max(width, ImGui::CalcTextSize(label.c_str()).x);
  return width;
}

void draw_axes(const ChartArea& area, ImDrawList& list) {
  const float font = ImGui::GetFontSize();
  list.AddRectFilled(area.low, area.high, kPaperColour);
  const std::vector<double> values = value_ticks(area);
  const std::vector<std::string> labels = common::tick_labels(values);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string& text = labels[i];
    const float y = area.y(values[i]), width = ImGui::CalcTextSize(text.c_str()).x;
    list.AddLine({area.low.x, y}, {area.high.x, y}, kGridColour);
    list.AddText({area.low.x - width - kLabelGap, y - 0.5f * font}, kTextColour, text.c_str());
  }
  const double columns = std::max(1.0f, std::floor((area.high.x - area.low.x) / (5.0f * font)));
  const std::vector<double> times = common::tick_values(area.from_s, area.to_s, columns);
  const std::vector<std::string> time_labels = common::tick_labels(times);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const std::string text = time_labels[i] + " s";
    const float x = area.x(times[i]), width = ImGui::CalcTextSize(text.c_str()).x;
    list.AddLine({x, area.low.y}, {x, area.high.y}, kGridColour);
    if (x + 0.5f * width < area.high.x + font)
      list.AddText({x - 0.5f * width, area.high.y + 2.0f}, kTextColour, text.c_str());
  }
  list.AddRect(area.low, area.high, kAxisColour);
}

void draw_curve(const std::vector<CurvePoint>& points, const ChartArea& area, ImU32 colour, float width,
                ImDrawList& list) {
  static std::vector<ImVec2> piece;  // reused
  const auto finish_piece = [&] {
    if (piece.size() == 1) list.AddCircleFilled(piece[0], width, colour);
    if (piece.size() > 1) list.AddPolyline(piece.data(), static_cast<int>(piece.size()), colour, 0, width);
    piece.clear();
  };
  for (const CurvePoint& point : points) {
    if (std::isnan(point.value))
      finish_piece();
    else
      piece.push_back({area.x(point.time_s), area.y(point.value)});
  }
  finish_piece();
}

ImU32 packed_curve_colour(std::size_t index) {
  const auto [red, green, blue] = curve_colour(index);
  return IM_COL32(red, green, blue, 255);
}

// A signal that was added in this frame has no values yet.
bool is_filled(const PlotData& data, std::size_t series) {
  return data.series()[series].values.size() == data.times().size();
}

std::size_t sample_at(const std::vector<double>& times, double time_s) {
  const auto next = std::ranges::lower_bound(times, time_s);
  if (next == times.end()) return times.size() - 1;
  const std::size_t i = next - times.begin();
  return i > 0 && time_s - times[i - 1] < times[i] - time_s ? i - 1 : i;
}

void draw_readout(const PlotData& data, const Chart& chart, const ChartArea& area, double time_s,
                  ImDrawList& list) {
  const std::size_t sample = sample_at(data.times(), time_s);
  const float x = area.x(data.times()[sample]);
  list.AddLine({x, area.low.y}, {x, area.high.y}, kNowColour);
  ImGui::BeginTooltip();
  ImGui::Text("%.3f s", data.times()[sample]);
  for (const std::size_t i : chart.series) {
    const PlotData::Series& series = data.series()[i];
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(packed_curve_colour(i)), "%s",
                       to_string(series.signal).c_str());
    ImGui::SameLine();
    if (std::isnan(series.values[sample]))
      ImGui::TextUnformatted("no value");
    else
      ImGui::Text("%.5g %s", series.values[sample], chart.unit.c_str());
  }
  ImGui::EndTooltip();
}

PlotExport make_export(const HudState& state, const FrameInput& input, const char* extension) {
  PlotExport plot{state.plot_file + extension, state.plotted.times(), {}};
  for (const PlotData::Series& series : state.plotted.series())
    if (series.values.size() == plot.times.size())
      plot.series.push_back(
          {to_string(series.signal), unit_of(series.signal, input.channels), series.values});
  return plot;
}

// Lists the run's own quantities and those of the selected item.
void draw_signal_menu(const FrameInput& input, HudState& state, Controls& controls) {
  ImGui::SetNextItemWidth(9.0f * ImGui::GetFontSize());
  if (!ImGui::BeginCombo("##add", "add a signal ...", ImGuiComboFlags_HeightLarge)) return;
  const auto entry = [&](const Signal& signal) {
    const bool shown = state.plotted.contains(signal);
    if (!ImGui::Selectable(to_string(signal).c_str(), shown, ImGuiSelectableFlags_DontClosePopups)) return;
    if (shown)
      state.plotted.remove(signal);
    else
      state.plotted.add(signal);
  };
  if (const auto& item = controls.tools().selected()) {
    for (const Signal& signal : signals_of(*item, input.channels)) entry(signal);
    ImGui::Separator();
  }
  if (input.history)
    for (const Signal& signal : input.history->run_signals()) entry(signal);
  ImGui::Separator();
  ImGui::TextDisabled("select an object or a cell for its signals");
  ImGui::EndCombo();
}

void draw_span_menu(HudState& state) {
  static constexpr double kSpans_s[] = {0.0, 60.0, 20.0, 5.0, 1.0};
  static constexpr const char* kNames[] = {"all", "60 s", "20 s", "5 s", "1 s"};
  const auto now = std::ranges::find(kSpans_s, state.plot_span_s) - std::begin(kSpans_s);
  int index = static_cast<int>(std::min<std::ptrdiff_t>(now, IM_ARRAYSIZE(kSpans_s) - 1));
  ImGui::SetNextItemWidth(5.0f * ImGui::GetFontSize());
  if (ImGui::Combo("##span", &index, kNames, IM_ARRAYSIZE(kNames))) state.plot_span_s = kSpans_s[index];
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("the time that the plots show");
}

// The plotted signals with their colours; a click on one removes it.
void draw_signal_names(HudState& state) {
  std::optional<Signal> removed;
  for (std::size_t i = 0; i < state.plotted.series().size(); ++i) {
    const Signal& signal = state.plotted.series()[i].signal;
    const std::string name = to_string(signal);
    const float width = ImGui::CalcTextSize(name.c_str()).x + 2.0f * ImGui::GetStyle().FramePadding.x;
    ImGui::SameLine();
    if (width > ImGui::GetContentRegionAvail().x) {
      ImGui::TextUnformatted("...");
      break;
    }
    ImGui::PushID(static_cast<int>(i));
    ImGui::PushStyleColor(ImGuiCol_Text, ImGui::ColorConvertU32ToFloat4(packed_curve_colour(i)));
    if (ImGui::SmallButton(name.c_str())) removed = signal;
    ImGui::PopStyleColor();
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("click: remove");
    ImGui::PopID();
  }
  if (removed) state.plotted.remove(*removed);
}

void draw_toolbar(const FrameInput& input, HudState& state, Controls& controls) {
  draw_signal_menu(input, state, controls);
  ImGui::SameLine();
  draw_span_menu(state);
  for (const char* const extension : {".csv", ".png"}) {
    ImGui::SameLine();
    if (ImGui::Button(extension[1] == 'c' ? "CSV" : "PNG") && !state.plotted.empty())
      controls.export_plot(make_export(state, input, extension));
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("write %s%s", state.plot_file.c_str(), extension);
  }
  draw_signal_names(state);
}

std::vector<Chart> charts_by_unit(const FrameInput& input, const HudState& state) {
  std::vector<Chart> charts;
  const std::vector<double>& times = state.plotted.times();
  const double end_s = times.back();
  const double from_s =
      state.plot_span_s > 0.0 ? std::max(times.front(), end_s - state.plot_span_s) : times.front();
  for (std::size_t i = 0; i < state.plotted.series().size(); ++i) {
    std::string unit = common::typeset_unit(unit_of(state.plotted.series()[i].signal, input.channels));
    auto chart = std::ranges::find(charts, unit, &Chart::unit);
    if (chart == charts.end())
      chart = charts.insert(charts.end(), {"chart", {}, unit, from_s, end_s, input.snapshot.time_s});
    chart->series.push_back(i);
  }
  return charts;
}

constexpr const char* kPayload = "signals";  // their texts, one a line

// All of the window is a target.
void accept_dragged_signals(PlotData& plotted) {
  const ImGuiWindow* const window = ImGui::GetCurrentWindow();
  if (!ImGui::BeginDragDropTargetCustom(window->Rect(), window->ID)) return;
  if (const ImGuiPayload* const payload = ImGui::AcceptDragDropPayload(kPayload)) {
    std::istringstream lines(std::string(static_cast<const char*>(payload->Data), payload->DataSize));
    for (std::string line; std::getline(lines, line);)
      if (const auto signal = parse_signal(line)) plotted.add(*signal);
  }
  ImGui::EndDragDropTarget();
}

}  // namespace

void make_draggable(const std::vector<Signal>& signals) {
  if (signals.empty() || !ImGui::BeginDragDropSource(ImGuiDragDropFlags_SourceAllowNullID)) return;
  std::string text;
  for (const Signal& signal : signals) text += to_string(signal) + "\n";
  ImGui::SetDragDropPayload(kPayload, text.data(), text.size());
  ImGui::TextUnformatted(text.data(), text.data() + text.size() - 1);
  ImGui::EndDragDropSource();
}

std::optional<double> draw_chart(const PlotData& data, const Chart& chart, float width, float height) {
  const float font = ImGui::GetFontSize();
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::InvisibleButton(chart.id, {std::max(width, 1.0f), std::max(height, 1.0f)});
  if (data.times().empty()) return std::nullopt;
  ChartArea area{{corner.x + 3.6f * font, corner.y + 0.3f * font},
                 {corner.x + width - 0.6f * font, corner.y + height - 1.4f * font},
                 chart.from_s,
                 std::max(chart.to_s, chart.from_s + kMinSpan_s),
                 {INFINITY, -INFINITY}};
  std::vector<std::vector<CurvePoint>> curves;
  for (const std::size_t i : chart.series) {
    if (!is_filled(data, i)) return std::nullopt;
    curves.push_back(reduce_curve(data.times(), data.series()[i].values, chart.from_s, chart.to_s,
                                  static_cast<int>(area.high.x - area.low.x)));
    for (const CurvePoint& point : curves.back())
      if (std::isfinite(point.value))
        area.values = {std::min(area.values.low, point.value), std::max(area.values.high, point.value)};
  }
  area.values = common::with_margin(area.values, 0.06);
  area.low.x =
      std::max(area.low.x, corner.x + widest(common::tick_labels(value_ticks(area))) + 2.0f * kLabelGap);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  draw_axes(area, list);
  list.PushClipRect(area.low, area.high, true);
  for (std::size_t i = 0; i < curves.size(); ++i)
    draw_curve(curves[i], area, packed_curve_colour(chart.series[i]), font / 8.0f, list);
  if (chart.now_s < chart.to_s)
    list.AddLine({area.x(chart.now_s), area.low.y}, {area.x(chart.now_s), area.high.y}, kNowColour, 2.0f);
  list.PopClipRect();
  const bool active = ImGui::IsItemActive();
  if (!ImGui::IsItemHovered() && !active) return std::nullopt;
  const double share =
      std::clamp<double>((ImGui::GetIO().MousePos.x - area.low.x) / (area.high.x - area.low.x), 0.0, 1.0);
  const double time_s = chart.from_s + share * (chart.to_s - chart.from_s);
  draw_readout(data, chart, area, time_s, list);
  return active ? std::optional(time_s) : std::nullopt;
}

void draw_plots_panel(const FrameInput& input, const Status& status, const DockRect& area, HudState& state,
                      Controls& controls) {
  begin_dock("plots", area);
  draw_toolbar(input, state, controls);
  if (state.plotted.empty() || state.plotted.times().empty()) {
    ImGui::TextDisabled(
        "Choose a signal, drag an object from the list of objects here, or click an object or a cell and "
        "then "
        "'plot' beside one "
        "of its quantities.");
  } else {
    const std::vector<Chart> charts = charts_by_unit(input, state);
    const float gap = ImGui::GetStyle().ItemSpacing.x;
    const ImVec2 space = ImGui::GetContentRegionAvail();
    const auto count = static_cast<float>(charts.size());
    for (std::size_t i = 0; i < charts.size(); ++i) {
      if (i > 0) ImGui::SameLine();
      ImGui::PushID(static_cast<int>(i));
      ImGui::BeginGroup();
      ImGui::TextDisabled("%s", charts[i].unit.empty() ? " " : ("[" + charts[i].unit + "]").c_str());
      const auto clicked_s = draw_chart(state.plotted, charts[i], (space.x - gap * (count - 1.0f)) / count,
                                        space.y - ImGui::GetTextLineHeightWithSpacing());
      ImGui::EndGroup();
      if (clicked_s && status.timeline) controls.seek_time(*clicked_s);
      ImGui::PopID();
    }
  }
  accept_dragged_signals(state.plotted);
  ImGui::End();
}

}  // namespace smartsurf::view
