#include <imgui.h>

#include <cstdio>

#include "common/text/Unit.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {

void draw_colour_scale(const ColourScale& colour_scale, float width, float scale) {
  constexpr int kSteps = 64;
  const ImVec2 bar(width, 12.0f * scale);
  ImGui::TextUnformatted(common::with_unit(colour_scale.channel, colour_scale.unit).c_str());
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
  if (colour_scale.has_gaps) {
    const ImVec2 box = ImGui::GetCursorScreenPos();
    const float edge = ImGui::GetTextLineHeight();
    ImGui::GetWindowDrawList()->AddRectFilled(
        box, {box.x + edge, box.y + edge},
        ImGui::ColorConvertFloat4ToU32({kNanColour[0], kNanColour[1], kNanColour[2], 1.0f}));
    ImGui::Dummy({edge, edge});
    ImGui::SameLine();
    ImGui::TextUnformatted("nothing seen");
  }
}

void draw_legend(const ColourScale& colour_scale, float bottom, float scale) {
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x - 12.0f * scale, bottom}, ImGuiCond_Always,
                          {1.0f, 1.0f});
  ImGui::SetNextWindowBgAlpha(0.88f);
  ImGui::Begin("legend", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoNav |
                   ImGuiWindowFlags_NoFocusOnAppearing);
  draw_colour_scale(colour_scale, 240.0f * scale, scale);
  ImGui::End();
}

void draw_line_legend(const OverlaySettings& overlay, const std::optional<ForceScale>& forces,
                      const std::string& missing, float scale) {
  ImGui::PushTextWrapPos(0.0f);
  const auto row = [&](ImU32 colour, const char* format, auto... values) {
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float y = at.y + 0.5f * ImGui::GetTextLineHeight(), length = 28.0f * scale;
    ImGui::GetWindowDrawList()->AddLine({at.x, y}, {at.x + length, y}, colour, 3.0f * scale);
    ImGui::Dummy({length, 1.0f});
    ImGui::SameLine();
    ImGui::TextWrapped(format, values...);
  };
  const auto packed = [](const std::array<std::uint8_t, 4>& c) { return IM_COL32(c[0], c[1], c[2], 255); };
  if (forces)
    row(packed(kContactColour), "contact force: %g mass·u/s² is %g u long", forces->force, forces->length);
  if (overlay.sensor_rays && missing.find("sensors") == missing.npos)
    row(packed(kSensorRayColour), "sensor ray, to what it detects");
  if (overlay.trails)
    row(IM_COL32(110, 116, 124, 255), "trail of the last %.1f s, in the object's colour",
        overlay.trail_length_s);
  if (!missing.empty()) ImGui::TextUnformatted(missing.c_str(), missing.c_str() + missing.size() - 1);
  ImGui::PopTextWrapPos();
}

}  // namespace smartsurf::view
