#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartsurf/view/panels/Icons.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

ImU32 mark_colour(EventMark::Kind kind) {
  switch (kind) {
    case EventMark::Kind::kSuccess:
      return IM_COL32(15, 125, 55, 255);
    case EventMark::Kind::kTouched:
      return IM_COL32(205, 95, 0, 255);
    case EventMark::Kind::kControllerLost:
      return IM_COL32(195, 25, 25, 255);
    case EventMark::Kind::kScript:
      break;
  }
  return IM_COL32(40, 95, 190, 255);
}

// Draws the marks under the slider from `low` to `high`; a click on one seeks to it.
void draw_event_marks(const Timeline& timeline, const ImVec2& low, const ImVec2& high, Controls& controls,
                      float scale) {
  const double span_s = timeline.end_s - timeline.begin_s;
  if (timeline.marks.empty() || span_s <= 0.0) return;
  const float size = 5.0f * scale, grab = ImGui::GetStyle().GrabMinSize / 2.0f;
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const EventMark* hovered = nullptr;
  float nearest = 1.5f * size;
  float drawn_at = -1e9f;
  EventMark::Kind drawn_kind{};
  for (const EventMark& mark : timeline.marks) {
    if (mark.time_s < timeline.begin_s || mark.time_s > timeline.end_s) continue;
    const float x =
        low.x + grab +
        static_cast<float>((mark.time_s - timeline.begin_s) / span_s) * (high.x - low.x - 2.0f * grab);
    const bool in_reach = mouse.y > high.y && mouse.y < high.y + 2.5f * size;
    if (in_reach && std::abs(mouse.x - x) < nearest) {
      nearest = std::abs(mouse.x - x);
      hovered = &mark;
    }
    if (mark.kind == drawn_kind && x - drawn_at < 1.0f) continue;
    drawn_at = x;
    drawn_kind = mark.kind;
    ImGui::GetWindowDrawList()->AddTriangleFilled({x, high.y + 1.0f}, {x - size, high.y + 2.0f * size},
                                                  {x + size, high.y + 2.0f * size}, mark_colour(mark.kind));
  }
  ImGui::SetCursorPosY(ImGui::GetCursorPosY() - ImGui::GetStyle().ItemSpacing.y);
  ImGui::Dummy({1.0f, 2.0f * size});
  if (!hovered) return;
  ImGui::SetTooltip("%.2f s: %s", hovered->time_s, hovered->text.c_str());
  if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) controls.seek_time(hovered->time_s);
}

// The words of the buttons are left out where the bar is narrow.
void draw_transport(const Status& status, Controls& controls, bool words) {
  const auto button = [&](Icon icon, const char* label, UiAction action, const char* tooltip,
                          bool enabled = true) {
    ImGui::BeginDisabled(!enabled);
    if (icon_button(icon, words ? label : (std::string("##") + label).c_str(), tooltip))
      controls.perform(action, status);
    ImGui::EndDisabled();
    ImGui::SameLine();
  };
  if (status.paused || status.run_ended)
    button(Icon::kRun, "Run", UiAction::kPause, status.run_ended ? "the run has ended" : "Run: Space",
           !status.run_ended);
  else
    button(Icon::kPause, "Pause", UiAction::kPause, "Pause: Space");
  button(Icon::kBack, "##Back", UiAction::kStepBack, "one tick back: left arrow");
  button(Icon::kForward, "##Forward", UiAction::kStep, "one tick forward: right arrow");
  button(Icon::kRestart, "Restart", UiAction::kReset,
         status.can_reset ? "Restart: Backspace" : "a run that writes files cannot be restarted here",
         status.can_reset);
}

void draw_speed_buttons(const Status& status, Controls& controls, bool words) {
  const auto button = [&](Icon icon, const char* label, UiAction action, const char* tooltip, bool on) {
    ImGui::SameLine();
    if (icon_button(icon, label, tooltip, on)) controls.perform(action, status);
  };
  button(Icon::kSlower, "##Slower", UiAction::kSlower, "slower: -", false);
  ImGui::SameLine();
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(format_pace(status.requested_pace).c_str());
  button(Icon::kFaster, "##Faster", UiAction::kFaster, "faster: +", false);
  button(Icon::kMaxSpeed, words ? "Max" : "##Max", UiAction::kMaxPace,
         "as fast as possible, or at real time: M", status.requested_pace <= 0.0);
}

void draw_slider(const Timeline& timeline, Controls& controls, float right, float scale) {
  char end_label[48];
  std::snprintf(end_label, sizeof(end_label), timeline.is_recording ? "%.2f s" : "now: %.2f s",
                timeline.end_s);
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%.2f s", timeline.begin_s);
  ImGui::SameLine();
  ImGui::SetNextItemWidth(std::max(right - ImGui::GetCursorPosX() - ImGui::CalcTextSize(end_label).x -
                                       2.0f * ImGui::GetStyle().ItemSpacing.x,
                                   40.0f * scale));
  int frame = static_cast<int>(timeline.current_frame);
  if (ImGui::SliderInt("##frame", &frame, 0, static_cast<int>(timeline.frame_count) - 1, "frame %d",
                       ImGuiSliderFlags_AlwaysClamp))
    controls.seek(frame);
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  ImGui::SameLine();
  ImGui::TextUnformatted(end_label);
  draw_event_marks(timeline, low, high, controls, scale);
}

}  // namespace

std::string format_pace(double pace) {
  char text[32];
  if (pace <= 0.0) return "max";
  if (pace < 1.0)
    std::snprintf(text, sizeof(text), "1/%.3g×", 1.0 / pace);
  else
    std::snprintf(text, sizeof(text), "%.3g×", pace);
  return text;
}

void draw_bar(const Status& status, const DockRect& area, HudState& state, Controls& controls, float scale) {
  begin_dock("bar", area, false);
  const float speed_width = 210.0f * scale;
  const bool one_row = area.width >= 900.0f * scale;
  const float content_right = ImGui::GetWindowContentRegionMax().x;
  draw_transport(status, controls, area.width >= 460.0f * scale);
  const float row_y = ImGui::GetCursorPosY();
  if (status.timeline && one_row) {
    draw_slider(*status.timeline, controls, content_right - speed_width, scale);
    const float below = ImGui::GetCursorPosY();
    ImGui::SetCursorPos({content_right - speed_width, row_y});
    ImGui::Dummy({0.0f, 0.0f});
    draw_speed_buttons(status, controls, true);
    ImGui::SetCursorPosY(std::max(below, ImGui::GetCursorPosY()));
  } else {
    ImGui::Dummy({0.0f, 0.0f});
    draw_speed_buttons(status, controls, area.width >= 460.0f * scale);
    if (status.timeline) draw_slider(*status.timeline, controls, content_right, scale);
  }
  state.bar_height =
      ImGui::GetCursorPosY() - ImGui::GetStyle().ItemSpacing.y + ImGui::GetStyle().WindowPadding.y;
  ImGui::End();
}

}  // namespace smartsurf::view
