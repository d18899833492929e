#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <ranges>
#include <string>

#include "common/text/Elide.h"
#include "smartsurf/view/panels/Icons.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

const ImVec4 kDimTextColour(0.36f, 0.40f, 0.46f, 1.0f), kWarningColour(0.75f, 0.25f, 0.05f, 1.0f);
constexpr int kMetricRows = 8;  // more of them scroll
constexpr ImGuiSliderFlags kSliderFlags = ImGuiSliderFlags_AlwaysClamp;
constexpr double kLargestReal = std::numeric_limits<double>::max() / 2.0;  // as ImGui's sliders require

bool is_recording(const Status& status) { return status.timeline && status.timeline->is_recording; }

bool is_sensor(const Channel& channel) { return channel.kind == scene::ChannelKind::kSensor; }

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "cone"};
constexpr const char* kToolNames[] = {"pick", "drop", "poke", "break"};
constexpr const char* kFaultNames[] = {"repaired", "stuck", "dead"};

// Returns whether the selection changed.
bool combo(const char* label, int& selected, const char* const* names, int count) {
  return ImGui::Combo(label, &selected, names, count);
}

void slider_double(const char* label, double& value, double low, double high, const char* format) {
  float number = static_cast<float>(value);
  if (ImGui::SliderFloat(label, &number, static_cast<float>(low), static_cast<float>(high), format))
    value = number;
}

void channel_combo(const FrameInput& input, const Status& status, OverlaySettings& overlay) {
  if (!ImGui::BeginCombo("##cells",
                         overlay.channel.empty() ? "cells: plain" : ("cells: " + overlay.channel).c_str()))
    return;
  if (ImGui::Selectable("plain", overlay.channel.empty())) overlay.channel.clear();
  for (const Channel& channel : input.channels)
    if (ImGui::Selectable(channel.name.c_str(), overlay.channel == channel.name))
      overlay.channel = channel.name;
  if (is_recording(status) && std::ranges::none_of(input.channels, is_sensor))
    ImGui::TextDisabled("no sensors in this recording");
  ImGui::EndCombo();
}

void draw_colour_scale_settings(OverlaySettings& overlay) {
  int palette = static_cast<int>(std::ranges::find(kPalettes, overlay.palette) - kPalettes.begin());
  if (combo("palette", palette, kPaletteNames.data(), static_cast<int>(kPaletteNames.size())))
    overlay.palette = kPalettes[palette];
  ImGui::Checkbox("low is bright", &overlay.reverse_palette);
  ImGui::Checkbox("manual range", &overlay.manual_range);
  if (!overlay.manual_range) return;
  ImGui::DragFloatRange2("##range", &overlay.low, &overlay.high, 0.05F, 0.0F, 0.0F, "%.2f", "%.2f");
}

void draw_drop_settings(DropSpec& drop) {
  int shape = static_cast<int>(drop.shape);
  if (combo("shape", shape, kShapeNames, IM_ARRAYSIZE(kShapeNames)))
    drop.shape = static_cast<scene::ShapeKind>(shape);
  slider_double("size", drop.size, 0.2, 6.0, "%.1f u");
  slider_double("drop height", drop.height, 0.0, 20.0, "%.1f u");
  ImGui::ColorEdit3("colour", &drop.colour.r, ImGuiColorEditFlags_NoInputs);
}

// A slider over the number's range, or a field that is dragged, by `step` per pixel, where any number will
// do. A typed number is exact, and stays in the range.
template <class Number>
void draw_number(const char* label, ImGuiDataType type, Number& number,
                 const std::optional<std::array<Number, 2>>& range, double step, const char* format) {
  if (range)
    ImGui::SliderScalar(label, type, &number, range->data(), range->data() + 1, format, kSliderFlags);
  else
    ImGui::DragScalar(label, type, &number, static_cast<float>(step), nullptr, nullptr, format);
}

void draw_text_option(const char* label, OptionEdit& edit) {
  if (edit.spec.choices.empty()) {
    char buffer[256];
    std::snprintf(buffer, sizeof buffer, "%s", edit.text.c_str());
    if (ImGui::InputText(label, buffer, sizeof buffer)) edit.text = buffer;
  } else if (ImGui::BeginCombo(label, edit.text.c_str())) {
    for (const std::string& choice : edit.spec.choices)
      if (ImGui::Selectable(choice.c_str(), choice == edit.text)) edit.text = choice;
    ImGui::EndCombo();
  }
}

void draw_option_edit(OptionEdit& edit) {
  const char* const label = edit.spec.name.c_str();
  ImGui::PushID(label);
  const bool highlighted = edit.changed();
  if (highlighted) ImGui::PushStyleColor(ImGuiCol_Text, {0.75f, 0.25f, 0.05f, 1.0f});
  switch (edit.spec.kind) {
    case OptionEdit::Kind::kInteger:
      draw_number(label, ImGuiDataType_S64, edit.integer, edit.integer_range(),
                  std::max(0.1, 0.005 * std::abs(static_cast<double>(edit.integer))), "%lld");
      break;
    case OptionEdit::Kind::kReal: {
      auto range = edit.spec.range;
      if (range)
        for (double& end : *range) end = std::clamp(end, -kLargestReal, kLargestReal);
      draw_number(label, ImGuiDataType_Double, edit.real, range,
                  edit.real == 0.0 ? 0.01 : 0.005 * std::abs(edit.real), "%.6g");
      break;
    }
    case OptionEdit::Kind::kBool:
      ImGui::Checkbox(label, &edit.checked);
      break;
    case OptionEdit::Kind::kText:
      draw_text_option(label, edit);
      break;
  }
  if (highlighted) ImGui::PopStyleColor();
  if (!edit.spec.help.empty() && ImGui::IsItemHovered()) ImGui::SetTooltip("%s", edit.spec.help.c_str());
  ImGui::PopID();
}

// The speed, and the requested one where that is another.
std::string format_speed(double actual, double requested) {
  if (actual <= 0.0) return format_pace(requested) + " wanted";
  char text[64];
  std::snprintf(text, sizeof(text), "%.2f× real time", actual);
  const bool kept = requested > 0.0 && std::abs(actual - requested) < 0.05 * requested;
  return kept ? text : text + (" (" + format_pace(requested) + " wanted)");
}

// A name that is wider than the room, pixels, is elided; a tooltip shows it all.
void draw_row_name(const std::string& name, float room) {
  const std::string shown = common::elide_middle(
      name, [&](const std::string& text) { return ImGui::CalcTextSize(text.c_str()).x <= room; });
  ImGui::TextColored(kDimTextColour, "%s", shown.c_str());
  if (shown != name && ImGui::IsItemHovered()) ImGui::SetTooltip("%s", name.c_str());
}

template <class... Values>
void table_row(const char* name, const char* format, Values... values) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(kDimTextColour, "%s", name);
  ImGui::TableNextColumn();
  ImGui::Text(format, values...);
}

void draw_state_rows(const scene::Snapshot& snapshot, const Status& status, const HudState& state) {
  table_row("time", "%.2f s", snapshot.time_s);
  table_row("tick", "%llu", static_cast<unsigned long long>(snapshot.tick));
  if (status.paused)
    table_row("speed", "%s", status.run_ended ? "the run has ended" : "paused");
  else
    table_row("speed", "%s", format_speed(status.actual_pace, status.requested_pace).c_str());
  if (!status.mode.empty()) table_row("mode", "%s", status.mode.c_str());
  if (!status.controller.empty()) table_row("controller", "%s", status.controller.c_str());
  table_row("objects", "%zu", snapshot.object_count());
  table_row("contacts", "%u", snapshot.contact_count);
  if (status.paused) return;  // costs are those of a run that goes on
  if (status.physics_ms > 0.0) table_row("physics", "%.2f ms/tick", status.physics_ms);
  table_row("drawing", "%.1f ms, %.0f frames/s", state.render_ms, 1000.0 / std::max(state.interval_ms, 1.0));
}

// Begins a table of a name and a value. A fitted column would cut a value that has just grown, for one frame.
bool begin_table(const char* id, ImGuiTableFlags flags = 0, float height = 0.0f) {
  if (!ImGui::BeginTable(id, 2, ImGuiTableFlags_SizingFixedFit | flags, {0.0f, height})) return false;
  ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed);
  ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
  return true;
}

// All metrics that have values. Many of them scroll.
void draw_metrics(const Status& status) {
  const auto has_value = [](const auto& metric) { return std::isfinite(metric.second); };
  const auto rows = std::ranges::count_if(status.metrics, has_value);
  if (rows == 0) return;
  const bool scrolls = rows > kMetricRows;
  const float padding = 2.0f * ImGui::GetStyle().CellPadding.y;
  const float height =
      scrolls ? (static_cast<float>(kMetricRows) + 0.5f) * (ImGui::GetTextLineHeight() + padding) : 0.0f;
  if (!begin_table("metrics", scrolls ? ImGuiTableFlags_ScrollY : 0, height)) return;
  const float room = ImGui::GetContentRegionAvail().x - ImGui::CalcTextSize("-1.234e-567").x -
                     4.0f * ImGui::GetStyle().CellPadding.x;
  for (const auto& [name, value] : status.metrics | std::views::filter(has_value)) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    draw_row_name(name, room);
    ImGui::TableNextColumn();
    ImGui::Text("%.4g", value);
  }
  ImGui::EndTable();
}

bool has_distance_sensors(const FrameInput& input) {
  return std::ranges::any_of(input.channels, [&](const Channel& channel) {
    return std::ranges::find(input.channels, channel.name + "_hit", &Channel::name) != input.channels.end();
  });
}

// The switches that are on and have nothing to show, in words; "": none.
std::string missing_lines(const FrameInput& input, const OverlaySettings& settings, const Status& status) {
  const char* const where = status.timeline && status.timeline->is_recording ? "in this recording" : "here";
  std::string missing;
  if (settings.sensor_rays && !has_distance_sensors(input))
    missing += std::string("no distance sensors ") + where +
               (is_recording(status) ? ": record { sensors = true } keeps them\n" : "\n");
  if (settings.contact_forces && !status.has_contacts)
    missing += std::string("no contact forces ") + where + "\n";
  return missing;
}

// The switches, highlighted while they are on.
void draw_switches(const FrameInput& input, const Status& status, Controls& controls) {
  const bool recorded = is_recording(status), rays = has_distance_sensors(input);
  struct Switch {
    Icon icon;
    const char* label;
    UiAction action;
    const char* tooltip;
  };
  const Switch switches[] = {
      {Icon::kWireframe, "Wireframe", UiAction::kWireframe, "objects as wireframes: W"},
      {Icon::kGrid, "Grid", UiAction::kGrid, "grid on the ground: G"},
      {Icon::kTrails, "Trails", UiAction::kTrails, "trails of the objects: T"},
      {Icon::kForces, "Forces", UiAction::kContactForces,
       status.has_contacts ? "contact forces: F"
       : recorded          ? "contact forces: F. A recording has none"
                           : "contact forces: F. They are known only at the present"},
      {Icon::kSensors, "Sensors", UiAction::kSensorRays,
       rays ? "rays of the distance sensors: S"
       : recorded
           ? "rays of the distance sensors: S. This recording has none: record { sensors = true } keeps them"
           : "rays of the distance sensors: S. This table has none"},
      {Icon::kLabels, "Labels", UiAction::kLabels, "labels of the objects: L"},
      {Icon::kList, "Objects", UiAction::kEntities, "list of objects and channels, with a search: O"},
      {Icon::kPlots, "Plots", UiAction::kPlots, "plots of quantities over time: P"}};
  const float gap = 0.3f * ImGui::GetFontSize(), width = 0.5f * (ImGui::GetContentRegionAvail().x - gap);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
  for (int i = 0; i < IM_ARRAYSIZE(switches); ++i) {
    const Switch& s = switches[i];
    if (icon_button(s.icon, s.label, s.tooltip, controls.is_on(s.action), width))
      controls.perform(s.action, status);
    if (i % 2 == 0) ImGui::SameLine();
  }
  ImGui::PopStyleVar();
}

void draw_camera_row(const Status& status, const HudState& state, Controls& controls) {
  const float gap = 0.3f * ImGui::GetFontSize();
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
  const auto button = [&](Icon icon, const char* label, UiAction action, const char* tooltip,
                          bool on = false) {
    if (icon_button(icon, label, tooltip, on)) controls.perform(action, status);
    ImGui::SameLine();
  };
  button(Icon::kTopView, "##Top", UiAction::kTop, "camera above the table: 1");
  button(Icon::kWholeTable, "##Whole", UiAction::kIso, "camera on the whole table: 2");
  button(Icon::kSideView, "##Side", UiAction::kSide, "camera beside the table: 3");
  button(Icon::kPicture, "##Screenshot", UiAction::kScreenshot, "screenshot: F12");
  button(Icon::kVideo, "##Video", UiAction::kVideo,
         state.recording_video ? "end the video: V" : "video of what is shown: V", state.recording_video);
  button(Icon::kHelp, "##Help", UiAction::kHelp, "all keys: F1", controls.help_shown());
  ImGui::NewLine();
  ImGui::PopStyleVar();
}

void draw_show_section(const FrameInput& input, const Status& status, const Overlay& overlay,
                       Controls& controls, float scale) {
  OverlaySettings& settings = controls.overlay();
  draw_switches(input, status, controls);
  ImGui::SetNextItemWidth(-1.0f);
  channel_combo(input, status, settings);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("what the colours of the cells show; C: the next channel");
  if (overlay.colour_scale()) {
    draw_colour_scale(*overlay.colour_scale(), ImGui::GetContentRegionAvail().x, scale);
    if (ImGui::TreeNode("Colours")) {
      draw_colour_scale_settings(settings);
      ImGui::TreePop();
    }
  }
  if (settings.trails) {
    ImGui::SetNextItemWidth(-1.0f);
    slider_double("##trail", settings.trail_length_s, 0.5, 30.0, "trails of %.1f s");
  }
  draw_line_legend(settings, overlay.force_scale(), missing_lines(input, settings, status), scale);
}

void draw_state(const FrameInput& input, const Status& status, const HudState& state) {
  if (begin_table("state")) {
    draw_state_rows(input.snapshot, status, state);
    ImGui::EndTable();
  }
  draw_metrics(status);
  ImGui::PushTextWrapPos(0.0f);
  if (!status.notice.empty()) ImGui::TextColored(kWarningColour, "%s", status.notice.c_str());
  if (!state.message.empty()) ImGui::TextUnformatted(state.message.c_str());
  ImGui::PopTextWrapPos();
}

void draw_tools_section(const Status& status, Controls& controls) {
  if (!status.accepts_interaction || !ImGui::CollapsingHeader("Tools")) return;
  Tools& tools = controls.tools();
  int tool = static_cast<int>(tools.active_tool);
  const int count = status.accepts_faults ? 4 : 3;
  for (int i = 0; i < count; ++i) {
    if (i > 0) ImGui::SameLine();
    if (ImGui::RadioButton(kToolNames[i], tool == i)) tools.active_tool = static_cast<Tool>(i);
  }
  if (tools.active_tool == Tool::kDrop) draw_drop_settings(tools.drop_spec);
  if (tools.active_tool == Tool::kPoke) slider_double("to height", tools.poke_height, 0.0, 10.0, "%.1f u");
  if (tools.active_tool == Tool::kBreak) {
    int fault = static_cast<int>(tools.fault_kind);
    if (combo("fault", fault, kFaultNames, IM_ARRAYSIZE(kFaultNames)))
      tools.fault_kind = static_cast<FaultKind>(fault);
  }
  ImGui::TextDisabled("Ctrl + drag: pull an object");
}

void draw_options_section(const Status& status, std::vector<OptionEdit>& edits, Controls& controls) {
  if (!status.can_reset || edits.empty() || !ImGui::CollapsingHeader("Options")) return;
  for (OptionEdit& edit : edits) draw_option_edit(edit);
  if (ImGui::Button("Restart")) controls.reset(changed_options(edits));
  ImGui::SameLine();
  ImGui::TextDisabled("applies the changes");
}

}  // namespace

void draw_main_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                     const Overlay& overlay, const DockRect& area, HudState& state, Controls& controls,
                     float scale) {
  begin_dock("main", area);
  const bool two_columns = area.width >= 500.0f * scale;
  if (two_columns) ImGui::BeginChild("left", {0.5f * ImGui::GetContentRegionAvail().x, 0.0f});
  draw_state(input, status, state);
  draw_camera_row(status, state, controls);
  if (two_columns) {
    ImGui::EndChild();
    ImGui::SameLine();
    ImGui::BeginChild("right");
  }
  ImGui::PushItemWidth(0.55f * ImGui::GetContentRegionAvail().x);
  draw_show_section(input, status, overlay, controls, scale);
  draw_tools_section(status, controls);
  draw_options_section(status, state.option_edits, controls);
  draw_entities_section(input, surface, state, controls);
  ImGui::PopItemWidth();
  if (two_columns) ImGui::EndChild();
  ImGui::End();
}

}  // namespace smartsurf::view
