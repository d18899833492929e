#include "smartsurf/view/panels/Panels.h"

#include <imgui.h>

#include <algorithm>
#include <cstdio>

namespace smartsurf::view {
namespace {

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "cone"};
constexpr const char* kToolNames[] = {"pick", "drop", "poke", "break"};
constexpr const char* kFaultNames[] = {"mended", "stuck", "dead"};

// A list to choose from; true when the choice changed.
bool choose(const char* label, int& chosen, const char* const* names, int count) {
  return ImGui::Combo(label, &chosen, names, count);
}

void slider(const char* label, double& value, double low, double high, const char* format) {
  float number = static_cast<float>(value);
  if (ImGui::SliderFloat(label, &number, static_cast<float>(low), static_cast<float>(high), format))
    value = number;
}

void choose_channel(const FrameInput& moment, OverlaySettings& overlay) {
  if (!ImGui::BeginCombo("cells", overlay.channel.empty() ? "height, plain" : overlay.channel.c_str()))
    return;
  if (ImGui::Selectable("height, plain", overlay.channel.empty())) overlay.channel.clear();
  for (const Channel& channel : moment.channels)
    if (ImGui::Selectable(channel.name.c_str(), overlay.channel == channel.name))
      overlay.channel = channel.name;
  ImGui::EndCombo();
}

void heat_settings(OverlaySettings& overlay) {
  int palette = static_cast<int>(std::ranges::find(kPalettes, overlay.palette) - kPalettes.begin());
  if (choose("palette", palette, kPaletteNames.data(), static_cast<int>(kPaletteNames.size())))
    overlay.palette = kPalettes[static_cast<std::size_t>(palette)];
  ImGui::Checkbox("low is bright", &overlay.near_is_bright);
  ImGui::Checkbox("own range", &overlay.own_range);
  if (!overlay.own_range) return;
  ImGui::DragFloatRange2("##range", &overlay.low, &overlay.high, 0.05F, 0.0F, 0.0F, "%.2f", "%.2f");
}

void drop_settings(DropSpec& drop) {
  int shape = static_cast<int>(drop.shape);
  if (choose("shape", shape, kShapeNames, IM_ARRAYSIZE(kShapeNames)))
    drop.shape = static_cast<scene::ShapeKind>(shape);
  slider("size", drop.size, 0.2, 6.0, "%.1f u");
  slider("fall", drop.height, 0.0, 20.0, "%.1f u");
  ImGui::ColorEdit3("colour", &drop.colour.r, ImGuiColorEditFlags_NoInputs);
}

void edit_option(OptionEdit& edit) {
  ImGui::PushID(edit.name.c_str());
  if (edit.changed()) ImGui::PushStyleColor(ImGuiCol_Text, {0.75f, 0.25f, 0.05f, 1.0f});
  const bool marked = edit.changed();
  switch (edit.kind) {
    case OptionEdit::Kind::kInteger:
    case OptionEdit::Kind::kReal:
      ImGui::SliderFloat(edit.name.c_str(), &edit.number, edit.low, edit.high,
                         edit.kind == OptionEdit::Kind::kInteger ? "%.0f" : "%.4g");
      if (edit.kind == OptionEdit::Kind::kInteger)
        edit.number = static_cast<float>(static_cast<long>(edit.number));
      break;
    case OptionEdit::Kind::kSwitch:
      ImGui::Checkbox(edit.name.c_str(), &edit.on);
      break;
    case OptionEdit::Kind::kText: {
      char buffer[256];
      std::snprintf(buffer, sizeof buffer, "%s", edit.text.c_str());
      if (ImGui::InputText(edit.name.c_str(), buffer, sizeof buffer)) edit.text = buffer;
      break;
    }
  }
  if (marked) ImGui::PopStyleColor();
  if (!edit.help.empty() && ImGui::IsItemHovered()) ImGui::SetTooltip("%s", edit.help.c_str());
  ImGui::PopID();
}

}  // namespace

void draw_visibility_section(const FrameInput& moment, const Status& status, Controls& controls) {
  if (!ImGui::CollapsingHeader("Show")) return;
  OverlaySettings& overlay = controls.overlay();
  choose_channel(moment, overlay);
  if (!overlay.channel.empty()) heat_settings(overlay);
  bool wires = controls.style() == Style::kWireframe, grid = controls.grid_shown();
  if (ImGui::Checkbox("wires (W)", &wires)) controls.press(Key::kWireframe, {});
  ImGui::SameLine();
  if (ImGui::Checkbox("grid (G)", &grid)) controls.press(Key::kGrid, {});
  ImGui::Checkbox("trails (T)", &overlay.trails);
  if (overlay.trails) {
    ImGui::SameLine();
    slider("##trail", overlay.trail_s, 0.5, 30.0, "%.1f s");
  }
  if (status.forces_known) {
    ImGui::Checkbox("forces (F)", &overlay.contacts);
    ImGui::SameLine();
  }
  ImGui::Checkbox("sensors (S)", &overlay.sensor_segments);
  bool labels = controls.labels_shown();
  if (ImGui::Checkbox("labels (L)", &labels)) controls.press(Key::kLabels, {});
}

void draw_tools_section(const Status& status, Controls& controls) {
  if (!status.touchable || !ImGui::CollapsingHeader("Tools")) return;
  Tools& tools = controls.tools();
  int tool = static_cast<int>(tools.tool);
  const int count = status.breakable ? 4 : 3;
  for (int i = 0; i < count; ++i) {
    if (i > 0) ImGui::SameLine();
    if (ImGui::RadioButton(kToolNames[i], tool == i)) tools.tool = static_cast<Tool>(i);
  }
  if (tools.tool == Tool::kDrop) drop_settings(tools.drop);
  if (tools.tool == Tool::kPoke) slider("to height", tools.poke_height, 0.0, 10.0, "%.1f u");
  if (tools.tool == Tool::kBreak) {
    int fault = static_cast<int>(tools.fault);
    if (choose("fault", fault, kFaultNames, IM_ARRAYSIZE(kFaultNames)))
      tools.fault = static_cast<FaultKind>(fault);
  }
  ImGui::TextDisabled("Ctrl + drag: pull an object");
}

void draw_options_section(const Status& status, std::vector<OptionEdit>& edits, Controls& controls) {
  if (!status.resettable || edits.empty() || !ImGui::CollapsingHeader("Options")) return;
  for (OptionEdit& edit : edits) edit_option(edit);
  if (ImGui::Button("Begin anew")) controls.reset(changes(edits));
  ImGui::SameLine();
  ImGui::TextDisabled("takes them over");
}

}  // namespace smartsurf::view
