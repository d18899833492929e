#include "smartsurf/view/panels/Icons.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

namespace smartsurf::view {
namespace {

// Strokes on a square of 16, separated by ';': l, a line through points; f, a filled convex polygon; c and d,
// an outlined and a filled circle by centre and radius.
const char* strokes(Icon icon) {
  switch (icon) {
    case Icon::kNone:
      return "";
    case Icon::kRun:
      return "f 4 2.5 13.5 8 4 13.5";
    case Icon::kPause:
      return "f 4 3 6.8 3 6.8 13 4 13;f 9.2 3 12 3 12 13 9.2 13";
    case Icon::kBack:
      return "f 12 3 5.5 8 12 13;l 3.5 3 3.5 13";
    case Icon::kForward:
      return "f 4 3 10.5 8 4 13;l 12.5 3 12.5 13";
    case Icon::kRestart:
      return "l 4 5 3 7.5 3.4 10.5 5.5 12.8 8.5 13.4 11.5 12.2 13 9.5 12.8 6.5 11 4.2 8 3.4;f 9 0.8 9 6.2 5 "
             "3.5";
    case Icon::kSlower:
      return "f 8 3.5 2 8 8 12.5;f 14 3.5 8 8 14 12.5";
    case Icon::kFaster:
      return "f 2 3.5 8 8 2 12.5;f 8 3.5 14 8 8 12.5";
    case Icon::kMaxSpeed:
      return "f 1 3.5 7 8 1 12.5;f 7 3.5 13 8 7 12.5;l 14.2 3.5 14.2 12.5";
    case Icon::kWireframe:
      return "l 8 1.5 13.8 4.8 13.8 11.2 8 14.5 2.2 11.2 2.2 4.8 8 1.5;l 2.2 4.8 8 8 13.8 4.8;l 8 8 8 14.5";
    case Icon::kGrid:
      return "l 2 2 14 2 14 14 2 14 2 2;l 2 6 14 6;l 2 10 14 10;l 6 2 6 14;l 10 2 10 14";
    case Icon::kTrails:
      return "l 1.5 13.5 5 12.8 7 10.5 8.5 7.5 10.5 5.5;d 12.5 4.5 2.3";
    case Icon::kForces:
      return "l 8 13.5 8 5;f 8 1.5 11.5 6.5 4.5 6.5;l 3 13.8 13 13.8";
    case Icon::kSensors:
      return "d 8 13 1.8;l 8 9.5 8 2;l 5.5 10.2 2.5 4;l 10.5 10.2 13.5 4";
    case Icon::kLabels:
      return "l 1.5 8 6 3.2 14.5 3.2 14.5 12.8 6 12.8 1.5 8;d 6.2 8 1.2";
    case Icon::kCells:
      return "f 2 2 7.3 2 7.3 7.3 2 7.3;l 9 2 14 2 14 7 9 7 9 2;l 2 9 7 9 7 14 2 14 2 9;f 8.7 8.7 14 8.7 14 "
             "14 8.7 14";
    case Icon::kFollow:
      return "c 8 8 4.5;d 8 8 1.5;l 8 1 8 4;l 8 12 8 15;l 1 8 4 8;l 12 8 15 8";
    case Icon::kList:
      return "l 6 4 14.5 4;l 6 8 14.5 8;l 6 12 14.5 12;d 2.8 4 1.2;d 2.8 8 1.2;d 2.8 12 1.2";
    case Icon::kPlots:
      return "l 2 2 2 14 14.5 14;l 4 11 7 7 9.5 9 13.5 3.5";
    case Icon::kTopView:
      return "l 3 3 13 3 13 13 3 13 3 3";
    case Icon::kWholeTable:
      return "l 8 3.5 15 8 8 12.5 1 8 8 3.5";
    case Icon::kSideView:
      return "l 1 12 15 12;f 3 7.5 13 7.5 13 11 3 11";
    case Icon::kPicture:
      return "l 1.5 5 5 5 6.2 3 9.8 3 11 5 14.5 5 14.5 13 1.5 13 1.5 5;c 8 8.8 2.5";
    case Icon::kVideo:
      return "l 1.5 4 10 4 10 12 1.5 12 1.5 4;f 10.8 8 14.8 4.5 14.8 11.5";
    case Icon::kHelp:
      return "c 8 8 6.5;l 5.8 6.3 6.4 4.9 8 4.3 9.7 5 10 6.6 8 8.3 8 9.6;d 8 11.6 0.9";
    case Icon::kOpen:
      return "l 1.5 13 1.5 3.5 6 3.5 7.5 5.2 13 5.2 13 7.5;l 1.5 13 4 7.5 15 7.5 12.8 13 1.5 13";
  }
  return "";
}

void draw_icon(Icon icon, const ImVec2& corner, float edge, ImU32 colour) {
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float unit = edge / 16.0f;
  const auto at = [&](float x, float y) { return ImVec2(corner.x + unit * x, corner.y + unit * y); };
  std::istringstream all(strokes(icon));
  for (std::string stroke; std::getline(all, stroke, ';');) {
    std::istringstream words(stroke);
    char kind = 0;
    words >> kind;
    std::vector<float> numbers;
    for (float number = 0.0f; words >> number;) numbers.push_back(number);
    if (kind == 'c') list.AddCircle(at(numbers[0], numbers[1]), unit * numbers[2], colour, 0, 1.5f * unit);
    if (kind == 'd') list.AddCircleFilled(at(numbers[0], numbers[1]), unit * numbers[2], colour);
    if (kind != 'l' && kind != 'f') continue;
    for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) list.PathLineTo(at(numbers[i], numbers[i + 1]));
    if (kind == 'l')
      list.PathStroke(colour, 0, 1.5f * unit);
    else
      list.PathFillConvex(colour);
  }
}

}  // namespace

bool icon_button(Icon icon, const char* label, const char* tooltip, bool on, float width) {
  const ImGuiStyle& style = ImGui::GetStyle();
  const float edge = ImGui::GetFontSize(), gap = 0.4f * edge;
  const ImVec2 text = ImGui::CalcTextSize(label, nullptr, true);
  const float contents = edge + (text.x > 0.0f ? gap + text.x : 0.0f);
  const ImVec2 size(width > 0.0f ? width : contents + 2.0f * style.FramePadding.x,
                    std::max(edge, text.y) + 2.0f * style.FramePadding.y);
  if (on) {
    ImGui::PushStyleColor(ImGuiCol_Button, {0.16f, 0.42f, 0.72f, 1.0f});
    ImGui::PushStyleColor(ImGuiCol_ButtonHovered, {0.22f, 0.48f, 0.78f, 1.0f});
    ImGui::PushStyleColor(ImGuiCol_Text, {1.0f, 1.0f, 1.0f, 1.0f});
  }
  ImGui::PushID(label);
  ImGui::PushID(static_cast<int>(icon));
  const bool pressed = ImGui::Button("##button", size);
  ImGui::PopID();
  ImGui::PopID();
  const ImVec2 low = ImGui::GetItemRectMin();
  const ImU32 colour = ImGui::GetColorU32(ImGuiCol_Text);
  const float x = low.x + (text.x > 0.0f ? style.FramePadding.x : 0.5f * (size.x - edge));
  draw_icon(icon, {x, low.y + 0.5f * (size.y - edge)}, edge, colour);
  const ImVec2 high = ImGui::GetItemRectMax();
  ImGui::GetWindowDrawList()->PushClipRect(low, high, true);
  ImGui::GetWindowDrawList()->AddText({x + edge + gap, low.y + style.FramePadding.y}, colour, label,
                                      ImGui::FindRenderedTextEnd(label));
  ImGui::GetWindowDrawList()->PopClipRect();
  if (on) ImGui::PopStyleColor(3);
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled) && tooltip[0] != '\0')
    ImGui::SetTooltip("%s", tooltip);
  return pressed;
}

}  // namespace smartsurf::view
