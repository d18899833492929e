#include <imgui.h>

#include <cstdio>

#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {

void draw_legend(const ColourScale& colour_scale, float bottom, float scale) {
  constexpr int kSteps = 64;
  const ImVec2 bar(240.0f * scale, 12.0f * scale);
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x - 12.0f * scale, bottom}, ImGuiCond_Always,
                          {1.0f, 1.0f});
  ImGui::SetNextWindowBgAlpha(0.88f);
  ImGui::Begin("legend", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoNav |
                   ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::Text("%s%s%s%s", colour_scale.channel.c_str(), colour_scale.unit.empty() ? "" : " [",
              colour_scale.unit.c_str(), colour_scale.unit.empty() ? "" : "]");
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float step = bar.x / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const Rgb c = common::palette_color(colour_scale.palette, (static_cast<float>(i) + 0.5f) / kSteps);
    ImGui::GetWindowDrawList()->AddRectFilled({at.x + step * static_cast<float>(i), at.y},
                                              {at.x + step * static_cast<float>(i + 1) + 0.5f, at.y + bar.y},
                                              ImGui::ColorConvertFloat4ToU32({c[0], c[1], c[2], 1.0f}));
  }
  ImGui::Dummy(bar);
  char high[32];
  std::snprintf(high, sizeof high, "%.4g", static_cast<double>(colour_scale.high));
  ImGui::Text("%.4g", static_cast<double>(colour_scale.low));
  ImGui::SameLine();
  ImGui::SetCursorPosX(ImGui::GetCursorPosX() + bar.x - ImGui::GetItemRectSize().x -
                       ImGui::CalcTextSize(high).x - ImGui::GetStyle().ItemSpacing.x);
  ImGui::TextUnformatted(high);
  ImGui::End();
}

}  // namespace smartsurf::view
