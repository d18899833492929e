#include "smartsurf/view/panels/Panels.h"

#include <imgui.h>

#include <algorithm>
#include <cstdio>

namespace smartsurf::view {
namespace {

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

void channel_combo(const FrameInput& input, OverlaySettings& overlay) {
  if (!ImGui::BeginCombo("cells", overlay.channel.empty() ? "height, plain" : overlay.channel.c_str()))
    return;
  if (ImGui::Selectable("height, plain", overlay.channel.empty())) overlay.channel.clear();
  for (const Channel& channel : input.channels)
    if (ImGui::Selectable(channel.name.c_str(), overlay.channel == channel.name))
      overlay.channel = channel.name;
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

void draw_option_edit(OptionEdit& edit) {
  ImGui::PushID(edit.name.c_str());
  if (edit.changed()) ImGui::PushStyleColor(ImGuiCol_Text, {0.75f, 0.25f, 0.05f, 1.0f});
  const bool highlighted = edit.changed();
  switch (edit.kind) {
    case OptionEdit::Kind::kInteger:
    case OptionEdit::Kind::kReal:
      ImGui::SliderFloat(edit.name.c_str(), &edit.number, edit.low, edit.high,
                         edit.kind == OptionEdit::Kind::kInteger ? "%.0f" : "%.4g");
      if (edit.kind == OptionEdit::Kind::kInteger)
        edit.number = static_cast<float>(static_cast<long>(edit.number));
      break;
    case OptionEdit::Kind::kBool:
      ImGui::Checkbox(edit.name.c_str(), &edit.checked);
      break;
    case OptionEdit::Kind::kText: {
      char buffer[256];
      std::snprintf(buffer, sizeof buffer, "%s", edit.text.c_str());
      if (ImGui::InputText(edit.name.c_str(), buffer, sizeof buffer)) edit.text = buffer;
      break;
    }
  }
  if (highlighted) ImGui::PopStyleColor();
  if (!edit.help.empty() && ImGui::IsItemHovered()) ImGui::SetTooltip("%s", edit.help.c_str());
  ImGui::PopID();
}

}  // namespace

void draw_visibility_section(const FrameInput& input, const Status& status, Controls& controls) {
  if (!ImGui::CollapsingHeader("Show")) return;
  OverlaySettings& overlay = controls.overlay();
  channel_combo(input, overlay);
  if (!overlay.channel.empty()) draw_colour_scale_settings(overlay);
  bool wires = controls.fill_mode() == FillMode::kWireframe, grid = controls.grid_shown();
  if (ImGui::Checkbox("wireframe (W)", &wires)) controls.perform(UiAction::kWireframe, {});
  ImGui::SameLine();
  if (ImGui::Checkbox("grid (G)", &grid)) controls.perform(UiAction::kGrid, {});
  ImGui::Checkbox("trails (T)", &overlay.trails);
  if (overlay.trails) {
    ImGui::SameLine();
    slider_double("##trail", overlay.trail_length_s, 0.5, 30.0, "%.1f s");
  }
  if (status.has_contacts) {
    ImGui::Checkbox("forces (F)", &overlay.contact_forces);
    ImGui::SameLine();
  }
  ImGui::Checkbox("sensors (S)", &overlay.sensor_rays);
  bool labels = controls.labels_shown();
  if (ImGui::Checkbox("labels (L)", &labels)) controls.perform(UiAction::kLabels, {});
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

}  // namespace smartsurf::view
